// Finds in a run the moment at which it is aligned with others: its start, the n-th step or disturbance, event or
// marker.
//
// A step is a new setpoint in auto mode, or a change of the duty by at least 0.01 in manual mode, from one stored
// sample to the next; a disturbance is a change of disturbance_m. It counts from the first sample that carries it, also
// where samples are missing before: it may then have come earlier, by at most `uncertain_s`. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "server/analysis/comparison/trace.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/query/run_events.hpp"

namespace server::analysis {

enum class AlignAt : std::uint8_t { start, step, disturbance, event, marker };
const char* text(AlignAt value);
inline constexpr std::array kAlignments{AlignAt::start, AlignAt::step, AlignAt::disturbance, AlignAt::event,
                                        AlignAt::marker};

inline constexpr int kMostAlignmentNumber = 10'000;

struct Alignment {
  AlignAt at = AlignAt::start;
  int number = 1;    // the n-th of them in the run
  std::string name;  // the kind of the events; the text of the markers, empty: any
};

// "step 2", "event detection 1", "marker 'valve' 1"
std::string in_words(const Alignment& alignment);

// invalid: what is given does not belong together, or there are no events of this kind.
Result<void> check_alignment(const Alignment& alignment);

struct AlignedAt {
  double at_s = 0;         // since the first sample of the run, as times_of() counts
  double uncertain_s = 0;  // it may have come so much earlier: the time since the sample before
  std::uint32_t span = 0;
  std::uint64_t seq = 0;  // of the first sample with it
  std::int64_t utc_us = 0;
};

// `times_s` are those of the points; `moments` are the run's events of this kind, or its markers. invalid: the run has
// nothing to align at; `run` names it, e.g. "run 3".
Result<AlignedAt> find_alignment(const std::string& run, std::span<const TracePoint> points,
                                 std::span<const double> times_s, const Alignment& alignment,
                                 std::span<const storage::RunMoment> moments);

}  // namespace server::analysis
