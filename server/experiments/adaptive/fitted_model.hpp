// The model that fits the runs of an experiment so far, as the result of a job `identify` says it.
#pragma once

#include <array>
#include <boost/asio/awaitable.hpp>
#include <cstddef>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "control/search/fit.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/jobs/job.hpp"
#include "server/storage/runs/run.hpp"

namespace server::experiments {

struct FittedModel {
  storage::JobId job = 0;
  control::FractionalModel model;
  std::string end;  // of the search, as in its result: "converged", or why it is not the optimum
  // None of a parameter that is not determined, and of a search that has not converged: its sigmas say nothing.
  std::array<std::optional<double>, control::kParameters> one_sigma;
  double residual_sd = 0;
  bool is_of_acceleration = true;  // else of a position that was measured
  double fit_percent = 0;
  std::vector<std::string> warnings;
};

// The parameter was fitted, and lies where its sigma means little.
bool is_at_bound(const FittedModel& fitted, std::size_t parameter);

// invalid: the search found no finite model, or this is no result of a job `identify`.
Result<FittedModel> fitted_model_from(storage::JobId job, const nlohmann::json& result);

nlohmann::json to_json(const FittedModel& fitted);

struct FitRequest {
  std::vector<storage::RunId> runs;
  bool is_fractional = true;                              // else the structure is chosen
  std::function<std::string()> actor;                     // in whose name now
  std::function<bool()> is_wanted = [] { return true; };  // false: it ends soon
};

// As a job of the station. conflict: it was not wanted any more.
using FitOfRuns = std::function<boost::asio::awaitable<Result<FittedModel>>(FitRequest request)>;

}  // namespace server::experiments
