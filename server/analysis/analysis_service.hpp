// Computations on a run: reads it page by page, and computes on a worker.
//
// Loop thread; history and worker outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <utility>
#include <vector>

#include "server/analysis/reference_import.hpp"
#include "server/analysis/run_recording.hpp"
#include "server/analysis/run_steps.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/query/history.hpp"

namespace server::analysis {

// Steps by the outside reference where there is one, and how far the robot's own position was from it.
struct RunMeasures {
  std::vector<MeasuredStep> steps;
  std::optional<storage::OutsideReference> reference;
  std::optional<EstimateError> estimate_error;  // over all of the reference
};

class AnalysisService {
 public:
  AnalysisService(storage::History& history, runtime::WorkerThread& maths) : history_{history}, maths_{maths} {}

  // The run's steps in order; invalid when the run has more samples than kMaxAnalysedSamples.
  boost::asio::awaitable<Result<RunMeasures>> measures(storage::RunId run);

  // Puts an outside record onto the clock of the run; errors of place_reference, and as above.
  boost::asio::awaitable<Result<PlacedReference>> place(storage::RunId run, ReferenceRequest request,
                                                        std::optional<storage::MarkerPlace> marker);

  // Runs job() on the same worker: for text that is too long for the loop.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job>> compute(Job job) {
    co_return co_await maths_.run(std::move(job));
  }

 private:
  // conflict: it was replaced or removed meanwhile.
  boost::asio::awaitable<Result<std::optional<storage::StoredReference>>> reference_of(storage::RunId run);
  // Of every sample of the run, what `of` makes of it.
  template <class Point>
  boost::asio::awaitable<Result<std::vector<Point>>> gather(storage::RunId run,
                                                            Point (*of)(const storage::StoredSample&));

  storage::History& history_;
  runtime::WorkerThread& maths_;
};

}  // namespace server::analysis
