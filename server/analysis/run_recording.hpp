// Turns the samples of a run into a recording for control/: one gapless, equally spaced piece of one boot.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/identification/identify.hpp"
#include "server/analysis/metrics/run_steps.hpp"
#include "server/analysis/run_window.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/runs/outside_reference.hpp"
#include "server/storage/runs/run.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::analysis {

inline constexpr std::size_t kMaxAnalysedSamples = 2'000'000;  // 5 h at 100 Hz; 80 MB
inline constexpr double kFewestUsable = 0.5;                   // of a window; see recording_of()

// All that is recorded of a run.
struct RunSamples {
  std::vector<storage::StoredSample> samples;
  std::optional<storage::StoredReference> reference;
  std::vector<storage::InterruptedPart> interrupted;
};

// From where motion is taken.
enum class ChannelChoice : std::uint8_t {
  best,     // a position from outside where the run has one, else the robot's own record
  outside,  // the position from outside, or a refusal
  robot,    // the robot's own record
};
const char* text(ChannelChoice value);

// A piece of a run, and what a reader of its numbers must know about it.
struct RunRecording {
  control::Recording recording;
  std::string channels_reason;  // why these channels are fitted
  std::vector<std::string> warnings;
  double position_sd_m = 0;  // of the mean weight of positions from outside, as their importer said; else 0
};

// In words; 0: the position is known; NaN: it is an estimate whose standard deviation is not known.
std::string position_sd_in_words(double largest_position_sd_m);
std::string channels_reason(double largest_position_sd_m);

// A position that was measured from outside, where `reference` has one of the window, is fitted as it was measured, at
// its own times: it contains no model, and no disturbance. Else, where position_sd_m is not known to be 0 throughout,
// position and velocity are the robot's estimates, and the recording holds the acceleration in their place. Else
// position_m is what was measured: without the disturbance, which the robot adds to it. A few skipped periods are
// missed ticks of the recording (control/search/missed_ticks.hpp), with a warning. Parts in which the experiment was
// interrupted stay in the recording, and their values are left out of a fit, with a warning.
// invalid: several spans to choose from, too few samples, or gaps or missing values; the detail names each (samples
// that were lost, apart from periods that the robot skipped) and the longest windows without one, as flags. The reason
// "too_little_usable": less than kFewestUsable of the window, but for interruptions after which it went on, has values
// for a fit.
Result<RunRecording> recording_of(const RunSamples& run, const RunWindow& window,
                                  ChannelChoice choice = ChannelChoice::best);

}  // namespace server::analysis
