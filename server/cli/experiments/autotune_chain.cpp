// Each stage asks, waits, and notes what came of it.
#include "server/cli/experiments/autotune_chain.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include "server/cli/accounts/fluid.hpp"
#include "server/cli/experiments/autotune_comparison.hpp"

namespace server::cli {

using nlohmann::json;

namespace {

constexpr double kUsOfAS = 1e6;

// The stages, as the file names them.
constexpr const char* kIdentification = "identification";
constexpr const char* kModel = "model";
constexpr const char* kTuning = "tuning";
constexpr const char* kController = "controller";
constexpr const char* kPush = "push";
constexpr const char* kRobotModel = "robot_model";
constexpr const char* kFluidModel = "fluid_model";
constexpr const char* kVerification = "verification";
constexpr const char* kComparison = "comparison";

json specification(const AutotuneRequest& request) {
  json spec{{"crossover_rad_s", request.crossover_rad_s}, {"phase_margin_deg", request.phase_margin_deg}};
  if (request.mu) spec["mu"] = *request.mu;
  return spec;
}

// What an ended job or experiment says of its end, in words.
std::string why(const json& ended) {
  for (const char* name : {"error", "detail", "reason"}) {
    const json given = ended.value(name, json());
    if (given.is_string() && !given.get<std::string>().empty()) return ": " + given.get<std::string>();
  }
  return "";
}

}  // namespace

json fixed_request(const AutotuneRequest& request) {
  json fixed{{"robot_id", request.robot_id},
             {"profile", request.profile},
             {"verify_profile", request.verify_profile},
             {"model_free", request.is_model_free},
             {"run_id", nullptr}};
  if (request.run) fixed["run_id"] = *request.run;
  if (!request.search.empty()) fixed["search"] = request.search;
  return fixed;
}

AutotuneChain::AutotuneChain(AskStation ask, AutotuneRequest request, AutotuneState& state, std::ostream& progress)
    : ask_{std::move(ask)},
      station_{ask_, [this](const json& now) { show(now); }},
      request_{std::move(request)},
      state_{state},
      progress_{progress} {}

AutotuneEnd AutotuneChain::run() {
  (void)(identify() && keep_model() && tune() && keep_controller() && push() && send_model() && store_fluid_model() &&
         verify() && compare());
  return end_;
}

bool AutotuneChain::stop(const std::string& stage, const std::string& why) {
  say(fmt::format("{}: {}", stage, why));
  end_ = AutotuneEnd::stopped;
  return false;
}

void AutotuneChain::say(const std::string& line) {
  fmt::print(progress_, "{}\n", line);
  progress_.flush();
}

// Once for each new thing that the station says.
void AutotuneChain::show(const json& now) {
  std::string line = now.at("state").get<std::string>();
  const json progress = now.value("progress", json());
  if (progress.is_object() && progress.contains("stage") && progress.at("stage").is_string()) {
    line += ", " + progress.at("stage").get<std::string>();
  }
  if (line == shown_) return;
  shown_ = line;
  say("  " + line);
}

// Begins it, unless one that has begun is still at work or has ended well.
std::optional<json> AutotuneChain::finished_job(const std::string& stage, const json& body) {
  if (const auto begun = state_.number(stage, "job_id")) {
    json job = station_.finished_job(*begun);
    if (job.at("state") == "done") return job;
    say(fmt::format("  job {} {}; it is begun again", *begun, job.at("state").get<std::string>()));
  }
  const auto id = station_.post("/api/v1/jobs", body).at("job_id").get<std::int64_t>();
  state_.note(stage, "job_id", id);
  json job = station_.finished_job(id);
  if (job.at("state") == "done") return job;
  stop(stage, fmt::format("job {} {}{}", id, job.at("state").get<std::string>(), why(job)));
  return std::nullopt;
}

std::optional<std::int64_t> AutotuneChain::run_of_experiment(const std::string& stage, const json& profile) {
  auto id = state_.number(stage, "experiment_id");
  json experiment;
  if (id) {
    station_.resume_what_was_left(*id);
    experiment = station_.finished_experiment(*id);
  }
  if (!id || experiment.at("state") != "done") {
    if (id)
      say(fmt::format("  experiment {} was {}; it is begun again", *id, experiment.at("state").get<std::string>()));
    const json body{{"robot_id", request_.robot_id}, {"profile", profile}};
    id = station_.post("/api/v1/experiments", body).at("experiment_id").get<std::int64_t>();
    state_.note(stage, "experiment_id", *id);
    experiment = station_.finished_experiment(*id);
  }
  if (experiment.at("state") != "done") {
    stop(stage, fmt::format("experiment {} was {}{}", *id, experiment.at("state").get<std::string>(), why(experiment)));
    return std::nullopt;
  }
  for (const json& run : experiment.at("runs")) {
    if (run.at("run_id").is_number_integer()) return run.at("run_id").get<std::int64_t>();
  }
  stop(stage, fmt::format("experiment {} recorded no run", *id));
  return std::nullopt;
}

bool AutotuneChain::identify() {
  if (state_.is_done(kIdentification)) return true;
  if (request_.run) {
    say(fmt::format("identification: run {}, as asked", *request_.run));
    state_.finish(kIdentification, {{"run_id", *request_.run}});
    return true;
  }
  say(fmt::format("identification: experiment on {}", request_.robot_id));
  const auto run = run_of_experiment(kIdentification, request_.profile);
  if (!run) return false;
  state_.finish(kIdentification, {{"run_id", *run}});
  say(fmt::format("identification: run {}", *run));
  return true;
}

json AutotuneChain::identify_body() const {
  const std::int64_t run = *state_.number(kIdentification, "run_id");
  json body{{"kind", "identify"}, {"run_id", run}, {"cut_at_gaps", true}};
  body.update(request_.search);
  if (request_.fit_to_s) body["to_s"] = *request_.fit_to_s;
  if (request_.validation_from_s) {
    body["validation_run_id"] = run;
    body["validation_from_s"] = *request_.validation_from_s;
  }
  return body;
}

bool AutotuneChain::keep_model() {
  if (request_.is_model_free || state_.is_done(kModel)) return true;
  const std::int64_t run = *state_.number(kIdentification, "run_id");
  say(fmt::format("model: fit of run {}", run));
  const auto job = finished_job(kModel, identify_body());
  if (!job) return false;
  const json& found = job->at("result");
  if (!found.at("fit_percent").is_number()) return stop(kModel, "the search found no finite model");
  const json body{{"kind", "model"},
                  {"name", fmt::format("autotune of {}, run {}", request_.robot_id, run)},
                  {"job_id", job->at("job_id")}};
  const auto id = station_.post("/api/v1/designs", body).at("design_id").get<std::int64_t>();
  state_.finish(kModel, {{"design_id", id},
                         {"parameters", found.at("parameters")},
                         {"estimator", found.value("estimator", json())},
                         {"fit_percent", found.at("fit_percent")},
                         {"validation", found.value("validation", json())},
                         {"warnings", found.value("warnings", json::array())},
                         {"doubts", found.value("doubts", json())}});
  say(fmt::format("model: design {}, fits to {:.1f} %", id, found.at("fit_percent").get<double>()));
  for (const json& warning : found.value("warnings", json::array())) {
    say("  warning: " + warning.get<std::string>());
  }
  return true;
}

// The duty range and period are those of the robot, so that it is predicted as it will run.
json AutotuneChain::tune_body() const {
  json body = specification(request_);
  if (request_.is_model_free) {
    body["kind"] = "tune_measured";
    body["run_id"] = *state_.number(kIdentification, "run_id");
  } else {
    body["kind"] = "tune";
    body["model_id"] = *state_.number(kModel, "design_id");
  }
  const json in_force = station_.get(fmt::format("/api/v1/robots/{}/controller", request_.robot_id)).at("controller");
  if (in_force.is_null()) return body;
  body["duty_min"] = in_force.at("duty_min");
  body["duty_max"] = in_force.at("duty_max");
  body["period_s"] = in_force.at("period_us").get<double>() / kUsOfAS;
  return body;
}

bool AutotuneChain::is_feasible() {
  if (tuning_.at("feasible").get<bool>()) return true;
  say("tuning: not feasible: " + tuning_.at("reason").get<std::string>());
  end_ = AutotuneEnd::infeasible;
  return false;
}

bool AutotuneChain::tune() {
  const json asked = specification(request_);
  if (state_.is_done(kTuning)) {
    if (state_.of(kTuning).at("asked") != asked) {
      throw std::runtime_error{fmt::format("a controller for {} is tuned already; give another file for {}",
                                           state_.of(kTuning).at("asked").dump(), asked.dump())};
    }
    tuning_ = station_.finished_job(*state_.number(kTuning, "job_id")).at("result");
    return true;
  }
  state_.forget(kTuning);  // a job of another specification, or one that found nothing
  say(fmt::format("tuning: {} rad/s, {} degrees", request_.crossover_rad_s, request_.phase_margin_deg));
  const auto job = finished_job(kTuning, tune_body());
  if (!job) return false;
  tuning_ = job->at("result");
  if (!is_feasible()) return false;
  const json controller{{"kp", tuning_.at("kp")}, {"kd", tuning_.at("kd")}, {"mu", tuning_.at("mu")}};
  state_.finish(kTuning, {{"asked", asked}, {"controller", controller}, {"achieved", tuning_.at("achieved")}});
  if (const std::string doubts = tuning_.value("plant_doubts_text", std::string{}); !doubts.empty()) {
    say("  the model: " + doubts);
  }
  say(fmt::format("tuning: kp {:.6g}, kd {:.6g}, mu {:.6g}", controller.at("kp").get<double>(),
                  controller.at("kd").get<double>(), controller.at("mu").get<double>()));
  return true;
}

bool AutotuneChain::keep_controller() {
  if (state_.is_done(kController)) return true;
  const json body{{"kind", "controller"},
                  {"name", fmt::format("autotune of {}, {:g} rad/s, {:g} degrees", request_.robot_id,
                                       request_.crossover_rad_s, request_.phase_margin_deg)},
                  {"job_id", *state_.number(kTuning, "job_id")}};
  const auto id = station_.post("/api/v1/designs", body).at("design_id").get<std::int64_t>();
  state_.finish(kController, {{"design_id", id}});
  say(fmt::format("controller: design {}", id));
  return true;
}

bool AutotuneChain::push() {
  if (state_.is_done(kPush)) return true;
  json body{{"design_id", *state_.number(kController, "design_id")}};
  if (request_.confirm) body["confirm"] = true;
  say(fmt::format("push: to {}", request_.robot_id));
  const json pushed = station_.post(fmt::format("/api/v1/robots/{}/controller", request_.robot_id), body);
  if (!pushed.at("verified").get<bool>()) {
    return stop(kPush, "the robot accepted the controller and has not reported it; nothing was moved with it");
  }
  const json& controller = pushed.at("in_force").at("controller");
  state_.finish(kPush, {{"command_id", pushed.at("command").at("command_id")},
                        {"controller_id", controller.at("controller_id")},
                        {"checksum", controller.at("checksum")}});
  say(fmt::format("push: controller {} is in force, bit for bit", controller.at("controller_id").dump()));
  return true;
}

// SAFETY: the model of another fluid, or of one that nobody has named, is not sent.
std::string AutotuneChain::why_not_sent(const json& run, const json& estimator) const {
  if (!estimator.is_object()) return "the file of this autotune does not have it; begin a new one";
  if (estimator.contains("refused")) return estimator.at("refused").get<std::string>();
  if (run.at("robot_id") != request_.robot_id) {
    return fmt::format("run {} is of another robot, {}", run.at("run_id").dump(), run.at("robot_id").dump());
  }
  const json fluid = station_.get("/api/v1/robots/" + request_.robot_id).at("fluid");
  const std::string named = fluid.is_string() ? fluid.get<std::string>() : "";
  if (!named.empty() && run.at("fluid") == named) return "";
  return fmt::format(
      "run {} was recorded in the fluid {}, and the robot is in {} (rheonaut robot fluid {} --set FLUID "
      "says which, before the run)",
      run.at("run_id").dump(), run.at("fluid").dump(), fluid.dump(), request_.robot_id);
}

json AutotuneChain::robot_model() const {
  const json& found = state_.of(kModel);
  json model = found.at("estimator");
  model["plant"] = found.at("parameters");
  model["name"] = fmt::format("autotune of {}, run {}", request_.robot_id, *state_.number(kIdentification, "run_id"));
  model["doubts"] = found.value("doubts", json());  // null: an earlier version has fitted it
  return model;
}

// Also when it was sent before and nothing is verified yet: the robot may have booted since.
bool AutotuneChain::send_model() {
  if (request_.is_model_free || state_.is_done(kVerification)) return true;
  state_.forget(kRobotModel);
  const json run = station_.get(fmt::format("/api/v1/runs/{}", *state_.number(kIdentification, "run_id")));
  const std::string not_sent = why_not_sent(run, state_.of(kModel).value("estimator", json()));
  if (!not_sent.empty()) {
    state_.finish(kRobotModel, {{"state", "not_sent"}, {"reason", not_sent}});
    say(fmt::format("robot model: not sent: {}; the robot's position stays as uncertain as before", not_sent));
    return true;
  }
  say(fmt::format("robot model: to {}", request_.robot_id));
  const json now = model_sent_to(ask_, request_.robot_id, {{"fluid", run.at("fluid")}, {"model", robot_model()}});
  const std::string state = now.at("state").get<std::string>(), reason = now.value("reason", "");
  if (!model_has_arrived(now)) return stop(kRobotModel, fmt::format("{}: {}", state, reason));
  state_.finish(kRobotModel, {{"state", state}, {"reason", reason}, {"fluid", run.at("fluid")}});
  say(state == "confirmed" ? "robot model: confirmed, read back bit for bit; until the robot boots or its fluid changes"
                           : "robot model: assumed: " + reason);
  return true;
}

bool AutotuneChain::store_fluid_model() {
  if (!request_.stores_fluid_model || state_.is_done(kFluidModel)) return true;
  const json fluid = state_.is_done(kRobotModel) ? state_.of(kRobotModel).value("fluid", json()) : json();
  if (!fluid.is_string()) return stop(kFluidModel, "the robot was not sent the model, so no fluid is given it");
  station_.post(path_of_fluid_model(fluid), robot_model());
  state_.finish(kFluidModel, {{"fluid", fluid}});
  say(fmt::format("fluid model: it is that of {} from now on, which other robots get when they are put into it",
                  fluid.get<std::string>()));
  return true;
}

bool AutotuneChain::verify() {
  if (state_.is_done(kVerification)) return true;
  say(fmt::format("verification: experiment on {}", request_.robot_id));
  const auto run = run_of_experiment(kVerification, request_.verify_profile);
  if (!run) return false;
  state_.finish(kVerification, {{"run_id", *run}});
  say(fmt::format("verification: run {}", *run));
  return true;
}

bool AutotuneChain::compare() {
  if (state_.is_done(kComparison)) return true;
  const std::int64_t run = *state_.number(kVerification, "run_id");
  const json metrics = station_.get(fmt::format("/api/v1/runs/{}/metrics", run));
  state_.finish(kComparison, {{"steps", comparison_of(metrics, tuning_)}});
  return true;
}

}  // namespace server::cli
