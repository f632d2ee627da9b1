// Chooses the runs of an experiment with `until`: fits what was recorded, and ends it when enough is known.
//
//   next() → choose → (a run) → next() → fit → choose → … → none: conclusion() says why
//
// Loop thread; it computes on the worker, and fits as a job of the station. What it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/experiments/adaptive/fitted_model.hpp"
#include "server/experiments/adaptive/next_excitation.hpp"
#include "server/runtime/worker.hpp"

namespace server::experiments {

// How it ended: for programs (docs/experiments.md), and in words.
struct Conclusion {
  std::string reason, detail;
};

class UntilKnown {
 public:
  UntilKnown(const Profile& profile, const FitOfRuns& fit, runtime::WorkerThread& maths)
      : profile_{profile}, fit_{fit}, maths_{maths} {}

  // The runs so far, as they were recorded; `in_use`: the model before there is a fit. An error: why it cannot go on.
  boost::asio::awaitable<Result<std::optional<Variant>>> next(std::vector<storage::RunId> runs,
                                                              std::function<std::string()> actor,
                                                              control::FractionalModel in_use,
                                                              std::function<bool()> is_wanted);

  // After none.
  const std::optional<Conclusion>& conclusion() const { return conclusion_; }
  // What is known after the latest run, as JSON; null before a fit.
  const nlohmann::json& knowledge() const { return knowledge_; }

 private:
  std::optional<Conclusion> conclusion_of(const std::optional<FittedModel>& fitted, const NextExcitation& found) const;
  std::string state_in_words(const std::optional<FittedModel>& fitted) const;
  nlohmann::json knowledge_of(const FittedModel& fitted, const std::optional<NextExcitation>& found) const;

  const Profile& profile_;
  const FitOfRuns& fit_;
  runtime::WorkerThread& maths_;
  std::vector<Variant> chosen_;
  std::optional<Conclusion> conclusion_;
  nlohmann::json knowledge_;
};

}  // namespace server::experiments
