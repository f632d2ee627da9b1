// Moves the runs' columns onto the rows that they have together.
#include "server/analysis/comparison/aligned_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace server::analysis {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

struct RowRange {
  std::int64_t first = 0, end = 0;
  std::size_t size() const { return static_cast<std::size_t>(end - first); }
};

RowRange common_rows(const std::vector<AlignedRun>& runs) {
  RowRange all{std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min()};
  for (const AlignedRun& run : runs) {
    if (run.trace.rows() == 0) continue;
    all.first = std::min(all.first, run.trace.first_row);
    all.end = std::max(all.end, run.trace.first_row + static_cast<std::int64_t>(run.trace.rows()));
  }
  return all;
}

// Every n-th row counted from the moment of alignment, so that this one stays.
std::vector<float> placed(const std::vector<float>& column, std::int64_t first_row, RowRange all, std::int64_t every) {
  std::vector<float> out;
  for (std::int64_t row = all.first; row < all.end; ++row) {
    if (row % every != 0) continue;
    const std::int64_t at = row - first_row;
    const bool is_there = at >= 0 && at < static_cast<std::int64_t>(column.size());
    out.push_back(is_there ? column[static_cast<std::size_t>(at)] : kNone);
  }
  return out;
}

void place(GridTrace& trace, RowRange all, std::int64_t every) {
  for (std::vector<float>& column : trace.values) column = placed(column, trace.first_row, all, every);
  trace.position_sd_m = placed(trace.position_sd_m, trace.first_row, all, every);
  if (trace.position_source == PositionSource::outside) {
    trace.own_position_m = placed(trace.own_position_m, trace.first_row, all, every);
  }
  trace.first_row = all.first;
}

Result<std::int64_t> coarsening(const TracesRequest& request, std::size_t runs, std::size_t rows) {
  const std::size_t values = rows * runs * (request.channels.size() + 1);
  const auto times = static_cast<std::int64_t>((values + request.most_values - 1) / request.most_values);
  if (times <= 1 || !request.grid_us) return std::max<std::int64_t>(times, 1);
  return fail(ErrorCode::invalid,
              fmt::format("that are {} values, at most {} are given; ask for a grid_us from {} on, fewer channels or a "
                          "part of the time",
                          values, request.most_values, *request.grid_us * times),
              "too_many_rows");
}

}  // namespace

Result<AlignedRuns> put_together(TracesRequest request, std::vector<AlignedRun> runs) {
  const RowRange all = common_rows(runs);
  if (all.first >= all.end) {
    return fail(ErrorCode::invalid, "no run has a sample in this part of the time", "nothing_recorded");
  }
  const auto every = coarsening(request, runs.size(), all.size());
  if (!every) return std::unexpected{every.error()};
  AlignedRuns aligned;
  const double step_s = request.grid().step_s;
  aligned.grid_s = step_s * static_cast<double>(*every);
  for (std::int64_t row = all.first; row < all.end; ++row) {
    if (row % *every == 0) aligned.time_s.push_back(static_cast<double>(row) * step_s);
  }
  for (AlignedRun& run : runs) place(run.trace, all, *every);
  if (request.reference_run) {
    const auto at = std::ranges::find(runs, *request.reference_run, &AlignedRun::id);
    aligned.reference = static_cast<std::size_t>(at - runs.begin());
  }
  aligned.request = std::move(request);
  aligned.runs = std::move(runs);
  return aligned;
}

std::vector<float> difference(const AlignedRuns& aligned, std::size_t run, std::size_t channel) {
  std::vector<float> out = aligned.runs[run].trace.values[channel];
  const std::vector<float>& from = aligned.runs[aligned.reference].trace.values[channel];
  for (std::size_t i = 0; i < out.size(); ++i) out[i] -= from[i];
  return out;
}

std::vector<float> difference_sd_m(const AlignedRuns& aligned, std::size_t run) {
  std::vector<float> out = aligned.runs[run].trace.position_sd_m;
  const std::vector<float>& from = aligned.runs[aligned.reference].trace.position_sd_m;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = std::hypot(out[i], from[i]);
  return out;
}

}  // namespace server::analysis
