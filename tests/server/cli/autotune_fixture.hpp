// A station that is played for autotune, and a fixture that asks it.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "server/cli/experiments/autotune.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {

using nlohmann::json;

inline json step_json(const char* cause, double start_m, double target_m, double settling_s) {
  return {{"cause", cause},
          {"start_m", start_m},
          {"target_m", target_m},
          {"position_source", "estimate"},
          {"position_sd_m", 0.0015},
          {"settling_s", settling_s},
          {"overshoot_percent", 0.5},
          {"rise_10_90_s", 0.8},
          {"steady_state_error_m", 1e-4}};
}

inline json doubted(json step) {
  step["position_doubt"] = "± 60 mm is 30 times the band of 2 mm: this shows the belief only";
  return step;
}

// Answers as the API does; an experiment takes three looks, a job two.
class PlayedStation {
 public:
  StationAnswer ask(const std::string& method, const std::string& target, const json& body) {
    if (++requests == fails_at) throw std::runtime_error{"the station does not answer"};
    if (method == "POST") return post(target, body);
    const std::string path = target.substr(0, target.find('?'));
    if (path.starts_with("/api/v1/experiments/")) return {200, experiment(number_in(path)), ""};
    if (path.starts_with("/api/v1/jobs/")) return {200, job(number_in(path)), ""};
    if (path == "/api/v1/robots/sim-1") return {200, {{"fluid", robot_fluid}, {"model", model_answer()}}, ""};
    if (path.starts_with("/api/v1/runs/") && !path.ends_with("/metrics")) {
      return {200, {{"run_id", number_in(path)}, {"robot_id", run_robot}, {"fluid", run_fluid}}, ""};
    }
    if (path == "/api/v1/robots/sim-1/controller") return {200, {{"controller", controller}}, ""};
    if (path.ends_with("/metrics")) {
      measured_run = path;
      return {200,
              {{"steps",
                {step_json("setpoint", 0, 0.1, 1.9), doubted(step_json("disturbance", 0.05, 0.1, 1.1)),
                 step_json("setpoint", 0.1, 0.3, 2.5)}}},
              ""};
    }
    return {404, {{"detail", "not found"}}, ""};
  }

  AskStation asker() {
    return [this](const std::string& method, const std::string& target, const json& body) {
      return ask(method, target, body);
    };
  }
  int count(const std::string& target) const {
    return static_cast<int>(std::ranges::count(posted, target, &std::pair<std::string, json>::first));
  }
  json body_of(const std::string& target, int nth = 0) const {
    for (const auto& [to, body] : posted) {
      if (to == target && nth-- == 0) return body;
    }
    return nullptr;
  }

  int requests = 0, fails_at = 0;
  std::vector<std::pair<std::string, json>> posted;  // without signs of life
  std::vector<std::string> life_and_looks;           // of experiments
  std::string measured_run;
  std::map<int, std::string> experiment_ends;  // by number; else done
  bool is_feasible = true, is_verified = true;
  std::string job_end = "done";
  json estimator = {{"model_gain_m_s", {1, 2, 3, 4}}, {"fit_error", 0.001}};
  std::string model_state = "confirmed", model_reason, run_robot = "sim-1";
  json robot_fluid = "water", run_fluid = "water";
  bool has_arrived = true;  // the model that it reports is the one that was sent
  int sendings = 0;         // answers before that
  json controller = {
      {"controller_id", 2}, {"checksum", 5}, {"duty_min", -0.5}, {"duty_max", 0.75}, {"period_us", 20'000}};

 private:
  static int number_in(const std::string& path) { return std::stoi(path.substr(path.rfind('/') + 1)); }

  StationAnswer post(const std::string& target, const json& body) {
    if (target.ends_with("/keep-alive")) {
      life_and_looks.emplace_back("life");
      return {200, json::object(), ""};
    }
    posted.emplace_back(target, body);
    if (target == "/api/v1/experiments") return {202, {{"experiment_id", ++experiments_}, {"state", "waiting"}}, ""};
    if (target == "/api/v1/jobs") {
      jobs_.push_back(body);
      return {202, {{"job_id", jobs_.size()}}, ""};
    }
    if (target == "/api/v1/designs") return {201, {{"design_id", ++designs_}}, ""};
    if (target == "/api/v1/robots/sim-1/model") return {200, {{"model", model_answer()}}, ""};
    if (target == "/api/v1/fluids/%77%61%74%65%72/model") return {200, json::object(), ""};
    if (target == "/api/v1/robots/sim-1/controller") {
      return {200,
              {{"verified", is_verified},
               {"command", {{"command_id", "77"}}},
               {"in_force", {{"controller", {{"controller_id", 9}, {"checksum", 1234}}}}}},
              ""};
    }
    return {404, {{"detail", "not found"}}, ""};
  }

  json experiment(int number) {
    life_and_looks.emplace_back("look");
    const bool is_running = ++looks_[number] < 3;
    const std::string end = experiment_ends.contains(number) ? experiment_ends.at(number) : "done";
    json answer{{"experiment_id", number}, {"state", is_running ? "running" : end}, {"reason", ""}};
    if (end != "done") {
      answer["reason"] = "position_sd";
      answer["detail"] = "position_sd_m is above 0.03";
    }
    answer["runs"] = {{{"index", 0}, {"run_id", 100 + number}, {"state", is_running ? "recording" : "ended"}}};
    answer["progress"] = {{"share", 0.5}, {"stage", "step 2 of 9"}};
    return answer;
  }

  json job(int number) {
    const bool is_running = ++looks_[1000 + number] < 2;
    json answer{{"job_id", number},
                {"ended_at_us", nullptr},
                {"state", "running"},
                {"error", nullptr},
                {"progress", {{"share", 0.2}, {"stage", "searching"}}}};
    if (is_running) return answer;
    answer["ended_at_us"] = 1;
    answer["state"] = job_end;
    if (job_end == "failed") answer["error"] = "duty is 0 throughout";
    const json& request = jobs_.at(static_cast<std::size_t>(number - 1));
    answer["result"] = request.at("kind") == "identify" ? fit() : tuning();
    return answer;
  }

  json model_answer() {
    const bool is_sending = sendings > 0 && sendings-- > 0;
    return {{"state", is_sending ? "sending" : model_state},
            {"reason", model_reason},
            {"fluid", robot_fluid},
            {"fit_error", is_sending || has_arrived ? json(0.001) : json()}};
  }

  json fit() const {
    return {{"parameters", {{"kp", 0.1}}},
            {"estimator", estimator},
            {"doubts", {{{"code", "residuals_not_white"}}}},
            {"fit_percent", 94.4},
            {"validation", {{"fit_percent", 94.1}}},
            {"warnings", {"b1 and alpha are hardly told apart"}}};
  }
  json tuning() const {
    const json offer{{"name", "iso-damped, nearest"},
                     {"crossover_rad_s", 6},
                     {"phase_margin_deg", 100},
                     {"kp", 60},
                     {"kd", 0.1},
                     {"mu", 0.9}};
    if (!is_feasible) {
      return {
          {"feasible", false}, {"reason", "theta = 107 degrees"}, {"nearest_all", {offer}}, {"relaxed", json::array()}};
    }
    json predicted{{"fluid", nullptr},
                   {"step", step_json("", 0, 0, 1.77)},
                   {"disturbance", step_json("", 0, 0, 1.0)},
                   {"experiment", {{"setpoint_m", 0.1}, {"disturbance_m", -0.05}}}};
    return {{"feasible", true},        {"kp", 30}, {"kd", 0.1}, {"mu", 0.95}, {"achieved", {{"phase_margin_deg", 90}}},
            {"predicted", {predicted}}};
  }

  int experiments_ = 0, designs_ = 0;
  std::vector<json> jobs_;
  std::map<int, int> looks_;
};

class AutotuneTest : public ToolTest {
 protected:
  AutotuneTest() {
    options.request.robot_id = "sim-1";
    options.request.crossover_rad_s = 3;
    options.request.phase_margin_deg = 90;
  }
  int tune() {
    out = {};
    progress = {};
    return run(options, station.asker(), out, progress);
  }
  // A new process: what was begun is known from the file alone.
  void resume_from(const char* name) { options.resume = folder_ / name; }

  PlayedStation station;
  Autotune options;
  std::ostringstream out, progress;
};

inline constexpr const char* kExperiments = "/api/v1/experiments";
inline constexpr const char* kJobs = "/api/v1/jobs";
inline constexpr const char* kDesigns = "/api/v1/designs";
inline constexpr const char* kPush = "/api/v1/robots/sim-1/controller";
inline constexpr const char* kRobotModel = "/api/v1/robots/sim-1/model";
inline constexpr const char* kFluidModel = "/api/v1/fluids/%77%61%74%65%72/model";

}  // namespace server::cli
