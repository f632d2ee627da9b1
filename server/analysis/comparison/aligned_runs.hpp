// Several runs on one time axis, and how far each is from one of them.
//
// The axis reaches from the earliest to the latest row of any run. Together the runs have a bounded number of values;
// where nobody asked for a grid it becomes coarser until they fit (every n-th row, no mean). The sd of a
// difference is that of two independent positions. Pure and slow for long runs: call it on a worker.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/analysis/comparison/grid_trace.hpp"
#include "server/storage/runs/run.hpp"

namespace server::analysis {

inline constexpr std::size_t kMostAlignedRuns = 12;
inline constexpr std::size_t kMaxComparedValues = 250'000;  // rows × runs × (channels + 1 for the sd)
inline constexpr std::int64_t kFinestGrid_us = 10'000;
inline constexpr std::int64_t kCoarsestGrid_us = 60'000'000;

struct TracesRequest {
  Alignment alignment;
  TraceChannels channels;
  std::optional<std::int64_t> grid_us;  // none: the finest that fits
  double from_s = -std::numeric_limits<double>::infinity();
  double to_s = std::numeric_limits<double>::infinity();
  std::optional<storage::RunId> reference_run;  // from which differences are taken; none: the first
  std::size_t most_values = kMaxComparedValues;

  TraceGrid grid() const { return {1e-6 * static_cast<double>(grid_us.value_or(kFinestGrid_us)), from_s, to_s}; }
};

struct AlignedRun {
  storage::RunId id = 0;
  std::string name;
  AlignedAt aligned;
  GridTrace trace;
};

struct AlignedRuns {
  TracesRequest request;
  double grid_s = 0;
  std::vector<double> time_s;  // since the moment of alignment
  std::vector<AlignedRun> runs;
  std::size_t reference = 0;  // index of the run from which differences are taken
};

// The runs' traces are on the request's grid. invalid: no run has a row in the window; more values than allowed on a
// grid that was asked for.
Result<AlignedRuns> put_together(TracesRequest request, std::vector<AlignedRun> runs);

// The column of a channel less that of the reference run; NaN where either has nothing.
std::vector<float> difference(const AlignedRuns& aligned, std::size_t run, std::size_t channel);
std::vector<float> difference_sd_m(const AlignedRuns& aligned, std::size_t run);  // of the position

}  // namespace server::analysis
