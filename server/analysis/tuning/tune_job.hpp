// The jobs `tune` and `tuning_map`: a controller for a specification, ready for robots and predicted in each fluid; and
// the specifications that have one.
//
// Computed on the thread of the jobs. Errors: a plant that cannot be tuned for, or a controller that cannot be
// discretised, in words. A specification without solution is a result.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/analysis/tuning/margin_sigmas.hpp"
#include "server/analysis/tuning/sampling.hpp"
#include "server/analysis/tuning/tuning_json.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/jobs/job_run.hpp"

namespace server::analysis {

struct TuneRequest {
  control::FractionalModel plant;
  PlantUncertainty plant_uncertainty;  // with the doubts counted
  ModelDoubts plant_doubts;
  OrderedJson plant_source;  // {"model_id": …}, {"fluid": …} or {"given": true}
  control::TuningSpec spec;
  double period_s = 0.01;
  std::optional<double> duty_min, duty_max;  // none: -1 and 1, and a robot keeps the range that it has
  std::vector<FluidPlant> fluids;            // in which the loop is predicted
};

// The answer of `rheonaut tune --json --robustness`, with `plant_source`, `discretised` and `predicted`; without
// robustness and these two where it is not feasible.
boost::asio::awaitable<Result<std::string>> tune_job(TuneRequest request, storage::JobRun& run);

struct TuningMapRequest {
  control::FractionalModel plant;
  OrderedJson plant_source;
  control::TuningMapSpec spec;
};

// The answer of `rheonaut tune --map --json`, with `plant_source`.
boost::asio::awaitable<Result<std::string>> tuning_map_job(TuningMapRequest request, storage::JobRun& run);

}  // namespace server::analysis
