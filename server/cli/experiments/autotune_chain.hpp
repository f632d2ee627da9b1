// The chain from an experiment to a controller that was seen to work, stage by stage:
//
//   identification   an experiment of the station, or a run that is named        → run
//   model            job `identify`, its result kept; none if it is model-free   → design
//   tuning           job `tune` for crossover and margin, in every fluid         → kp, kd, mu, coefficients, prediction
//                    model-free: job `tune_measured` on the run                  → kp, kd, mu, coefficients
//   controller       its result kept                                             → design
//   push             sent, reported back by the robot, compared bit for bit      → in force
//   robot_model      the model, for the robot's estimator, sent and read back    → confirmed, assumed, not_sent
//   fluid_model      if asked for: it becomes the model of that fluid            → other robots in it
//   verification     an experiment in closed loop                                → run
//   comparison       its metrics beside the prediction
//
// A stage that is done is not done again: AutotuneState. What has begun on the station is watched on, and begun anew if
// it did not end well. Errors: throws std::runtime_error with what the station refused.
#pragma once

#include <iosfwd>
#include <optional>
#include <string>

#include "server/cli/experiments/autotune_state.hpp"
#include "server/cli/experiments/station_work.hpp"

namespace server::cli {

struct AutotuneRequest {
  std::string robot_id;
  nlohmann::json profile = "identification_set";  // a name, or a document
  nlohmann::json verify_profile = "figure_7";
  std::optional<std::int64_t> run;          // instead of the first experiment
  std::optional<double> fit_to_s;           // of the run; none: to its end
  std::optional<double> validation_from_s;  // the rest of the run, of which nothing is fitted; none: no validation
  nlohmann::json search = nlohmann::json::object();  // of the model: fields of its job, those that were given
  double crossover_rad_s = 0, phase_margin_deg = 0;
  std::optional<double> mu;
  bool is_model_free = false;       // the profile, or the run, has three tones; no model is found
  bool confirm = false;             // of a controller with a wider duty range than the one in force
  bool stores_fluid_model = false;  // the model becomes that of the robot's fluid, which other robots get later
};

// What the file of an autotune must agree with; the specification may change until a controller is kept.
nlohmann::json fixed_request(const AutotuneRequest& request);

enum class AutotuneEnd {
  done,
  infeasible,  // nothing meets the specification: tuning() says why, and what comes near
  stopped,     // an experiment was aborted, a job failed, or a controller is not verified; progress says which
};

class AutotuneChain {
 public:
  // A line for each stage, and what the station says meanwhile, goes to `progress`.
  AutotuneChain(AskStation ask, AutotuneRequest request, AutotuneState& state, std::ostream& progress);

  AutotuneEnd run();

  const nlohmann::json& tuning() const { return tuning_; }  // the result of the job

 private:
  // Each is false when the chain ends there.
  bool identify();
  bool keep_model();
  bool tune();
  bool keep_controller();
  bool push();
  bool send_model();
  bool store_fluid_model();
  bool verify();
  bool compare();

  // None: it did not end well.
  std::optional<nlohmann::json> finished_job(const std::string& stage, const nlohmann::json& body);
  std::optional<std::int64_t> run_of_experiment(const std::string& stage, const nlohmann::json& profile);
  nlohmann::json identify_body() const;
  nlohmann::json tune_body() const;
  // Why the model is not for this robot; empty: it is.
  std::string why_not_sent(const nlohmann::json& run, const nlohmann::json& estimator) const;
  nlohmann::json robot_model() const;  // of the model, as the API takes it
  bool is_feasible();                  // of the result; says why not
  void say(const std::string& line);
  bool stop(const std::string& stage, const std::string& why);  // false
  void show(const nlohmann::json& job_or_experiment);

  AskStation ask_;
  StationWork station_;
  AutotuneRequest request_;
  AutotuneState& state_;
  std::ostream& progress_;
  nlohmann::json tuning_;
  AutotuneEnd end_ = AutotuneEnd::done;
  std::string shown_;  // the last line of progress
};

}  // namespace server::cli
