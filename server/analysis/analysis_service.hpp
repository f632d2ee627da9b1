// What can be computed from a run: reads it page by page, and does the mathematics on a worker.
//
// Loop thread; history and worker outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <vector>

#include "server/analysis/run_recording.hpp"
#include "server/analysis/run_steps.hpp"
#include "server/recording/history.hpp"
#include "server/result.hpp"
#include "server/worker.hpp"

namespace server {

class AnalysisService {
 public:
  AnalysisService(History& history, WorkerThread& maths) : history_{history}, maths_{maths} {}

  // The run's steps in order; invalid when the run has more samples than kMaxAnalysedSamples.
  boost::asio::awaitable<Result<std::vector<MeasuredStep>>> steps(RunId run);

 private:
  boost::asio::awaitable<Result<std::vector<StepPoint>>> points(RunId run);

  History& history_;
  WorkerThread& maths_;
};

}  // namespace server
