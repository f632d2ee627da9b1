// Computations on a run: reads it page by page, and computes on a worker.
//
// Loop thread; history and worker outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <utility>
#include <vector>

#include "server/analysis/comparison/trace.hpp"
#include "server/analysis/metrics/run_figures.hpp"
#include "server/analysis/metrics/run_steps.hpp"
#include "server/analysis/reference_import.hpp"
#include "server/analysis/run_recording.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/query/history.hpp"

namespace server::analysis {

struct RunTrace {
  std::vector<TracePoint> points;
  std::optional<storage::StoredReference> reference;
};

class AnalysisService {
 public:
  AnalysisService(storage::History& history, runtime::WorkerThread& maths) : history_{history}, maths_{maths} {}

  // The run's steps in order; invalid when the run has more samples than kMaxAnalysedSamples.
  boost::asio::awaitable<Result<RunMeasures>> measures(storage::RunId run);

  // Steps and figures; errors as above.
  boost::asio::awaitable<Result<RunMetrics>> metrics(storage::Run run);

  // For plots and comparisons; errors as above, with this limit.
  boost::asio::awaitable<Result<RunTrace>> trace(storage::RunId run, std::size_t limit = kMaxAnalysedSamples);

  // What is said of the position that was measured from outside, if the run has one.
  boost::asio::awaitable<Result<std::optional<storage::OutsideReference>>> reference(storage::RunId run);

  // In order of span and seq; invalid when there are more than `limit`; unavailable while the disk does not take what
  // happened in the run.
  boost::asio::awaitable<Result<RunSamples>> samples(storage::RunId run, std::size_t limit);

  // Puts an outside record onto the clock of the run; errors of place_reference, and as above.
  boost::asio::awaitable<Result<PlacedReference>> place(storage::RunId run, ReferenceRequest request,
                                                        std::optional<storage::MarkerPlace> marker);

  // Runs job() on the same worker: for text that is too long for the loop.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job>> compute(Job job) {
    co_return co_await maths_.run(std::move(job));
  }

 private:
  boost::asio::awaitable<Result<std::vector<storage::InterruptedPart>>> interrupted_parts(storage::RunId run);
  // conflict: it was replaced or removed meanwhile.
  boost::asio::awaitable<Result<std::optional<storage::StoredReference>>> reference_of(storage::RunId run);
  // Of every sample of the run, what `of` makes of it.
  template <class Point>
  boost::asio::awaitable<Result<std::vector<Point>>> gather(storage::RunId run,
                                                            Point (*of)(const storage::StoredSample&),
                                                            std::size_t limit = kMaxAnalysedSamples);

  storage::History& history_;
  runtime::WorkerThread& maths_;
};

}  // namespace server::analysis
