// One run on a uniform grid of time around the moment at which it is aligned.
//
// Between two consecutive samples a channel changes in a straight line, or holds (TraceChannel); before the first,
// after the last and where samples are missing there is nothing: a gap stays one. Where the run has a position measured
// from outside, that one, with the disturbance, takes the place of the robot's own, which stands beside it; where the
// outside one is missing for more than 0.11 s there is nothing either. Pure and slow for long runs: call it on a
// worker.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "server/analysis/comparison/alignment.hpp"
#include "server/analysis/comparison/trace.hpp"
#include "server/analysis/comparison/trace_channel.hpp"
#include "server/storage/runs/outside_reference.hpp"

namespace server::analysis {

inline constexpr std::size_t kMaxGridRows = 1'000'000;  // of one run

enum class PositionSource : std::uint8_t { outside, estimate, known };
const char* text(PositionSource value);

struct TraceGrid {
  double step_s = 0.01;
  double from_s = -std::numeric_limits<double>::infinity();  // since the moment of alignment; both ends included
  double to_s = std::numeric_limits<double>::infinity();
};

// Row k is at (first_row + k) step_s. All columns have the same length; NaN: nothing.
struct GridTrace {
  std::int64_t first_row = 0;
  std::vector<std::vector<float>> values;  // a column for each channel
  std::vector<float> position_sd_m;        // of the position in `values`
  std::vector<float> own_position_m;       // where the position is from outside: the robot's own; else empty
  PositionSource position_source = PositionSource::known;

  std::size_t rows() const { return position_sd_m.size(); }
};

// invalid: more than kMaxGridRows; `run` names it.
Result<GridTrace> trace_on_grid(const std::string& run, std::span<const TracePoint> points,
                                std::span<const double> times_s, double aligned_at_s, const TraceChannels& channels,
                                const TraceGrid& grid, const storage::StoredReference* reference);

}  // namespace server::analysis
