// The chain of autotune against a station that is played: what is asked in which order, what is not done twice, and how
// each stage may end.
#include "server/cli/experiments/autotune.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <map>
#include <sstream>

#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

json step_json(const char* cause, double start_m, double target_m, double settling_s) {
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

json doubted(json step) {
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

  static json fit() {
    return {{"parameters", {{"kp", 0.1}}},
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

constexpr const char* kExperiments = "/api/v1/experiments";
constexpr const char* kJobs = "/api/v1/jobs";
constexpr const char* kDesigns = "/api/v1/designs";
constexpr const char* kPush = "/api/v1/robots/sim-1/controller";

TEST_F(AutotuneTest, AsksForEachStageInOrderAndComparesAtTheEnd) {
  ASSERT_EQ(tune(), 0) << progress.str();
  std::vector<std::string> order;
  for (const auto& [target, body] : station.posted) order.push_back(target);
  EXPECT_THAT(order, ElementsAre(kExperiments, kJobs, kDesigns, kJobs, kDesigns, kPush, kExperiments));
  EXPECT_EQ(station.body_of(kExperiments), (json{{"robot_id", "sim-1"}, {"profile", "identification_set"}}));
  EXPECT_EQ(station.body_of(kExperiments, 1)["profile"], "figure_7");
  const json identify = station.body_of(kJobs), tuning = station.body_of(kJobs, 1);
  EXPECT_EQ(identify["run_id"], 101);
  EXPECT_EQ(identify["validation_run_id"], 101);
  EXPECT_EQ(identify["to_s"], identify["validation_from_s"]) << "nothing is fitted to what it is tried on";
  EXPECT_EQ(station.body_of(kDesigns)["job_id"], 1);
  EXPECT_EQ(station.body_of(kDesigns)["kind"], "model");
  EXPECT_EQ(tuning, (json{{"kind", "tune"},
                          {"model_id", 1},
                          {"crossover_rad_s", 3.0},
                          {"phase_margin_deg", 90.0},
                          {"duty_min", -0.5},
                          {"duty_max", 0.75},
                          {"period_s", 0.02}}));
  EXPECT_EQ(station.body_of(kDesigns, 1)["kind"], "controller");
  EXPECT_EQ(station.body_of(kDesigns, 1)["job_id"], 2);
  EXPECT_EQ(station.body_of(kPush), (json{{"design_id", 2}})) << "what was kept, and no confirmation by itself";
  EXPECT_EQ(station.measured_run, "/api/v1/runs/102/metrics");
  EXPECT_THAT(out.str(), HasSubstr("setpoint 0 to 0.1 m, measured"));
  EXPECT_THAT(out.str(), HasSubstr("1.90"));
  EXPECT_THAT(out.str(), HasSubstr("1.77"));
  EXPECT_THAT(out.str(), HasSubstr("disturbance 0.05 to 0.1 m: ± 60 mm is 30 times the band")) << "as the station says";
  EXPECT_THAT(out.str(), HasSubstr("robot controller sim-1 --restore"));
  EXPECT_THAT(progress.str(), HasSubstr("warning: b1 and alpha are hardly told apart"));
  EXPECT_THAT(progress.str(), HasSubstr("  running, step 2 of 9"));
}

TEST_F(AutotuneTest, WithoutAModelARunWithTonesGoesToTheTuner) {
  options.request.is_model_free = true;
  ASSERT_EQ(tune(), 0) << progress.str();
  const json step = station.body_of(kExperiments)["profile"]["step"][0];
  EXPECT_EQ(step["kind"], "tones");
  EXPECT_EQ(step["crossover_rad_s"], 3.0);
  EXPECT_EQ(step["amplitude_m"], 0.02);
  EXPECT_EQ(station.count(kJobs), 1) << "no model is looked for";
  EXPECT_EQ(station.body_of(kJobs), (json{{"kind", "tune_measured"},
                                          {"run_id", 101},
                                          {"crossover_rad_s", 3.0},
                                          {"phase_margin_deg", 90.0},
                                          {"duty_min", -0.5},
                                          {"duty_max", 0.75},
                                          {"period_s", 0.02}}));
  EXPECT_EQ(station.count(kDesigns), 1);
  EXPECT_EQ(station.body_of(kPush), (json{{"design_id", 1}}));
}

// SAFETY's test: a robot moves only while its experiment is watched, so each look comes behind a sign of life.
TEST_F(AutotuneTest, GivesASignOfLifeBeforeEachLook) {
  ASSERT_EQ(tune(), 0);
  ASSERT_EQ(station.life_and_looks.size(), 12U) << "two experiments, three looks each";
  for (std::size_t i = 0; i < station.life_and_looks.size(); ++i) {
    EXPECT_EQ(station.life_and_looks[i], i % 2 == 0 ? "life" : "look") << i;
  }
}

TEST_F(AutotuneTest, ComparesStepsOfTheSizeThatWasPredictedOnly) {
  options.json = true;
  ASSERT_EQ(tune(), 0);
  const json steps = json::parse(out.str()).at("stages").at("comparison").at("steps");
  ASSERT_EQ(steps.size(), 3U);
  EXPECT_EQ(steps[0]["measured"]["settling_s"], 1.9);
  EXPECT_EQ(steps[0]["predicted"]["settling_s"], 1.77);
  EXPECT_EQ(steps[1]["predicted"]["settling_s"], 1.0) << "the disturbance";
  EXPECT_EQ(steps[2]["predicted"], nullptr) << "a step of 0.2 m was not predicted";
}

// Interrupted at every request that it makes, the next call goes on: no experiment and no push is done twice.
TEST_F(AutotuneTest, GoesOnWhereItWasInterrupted) {
  ASSERT_EQ(tune(), 0);
  const int requests = station.requests;
  ASSERT_GT(requests, 20);
  for (int at = 1; at <= requests; ++at) {
    station = {};
    resume_from(fmt::format("{}.json", at).c_str());
    station.fails_at = at;
    EXPECT_THROW(tune(), std::runtime_error) << at;
    ASSERT_EQ(tune(), 0) << at << progress.str();
    EXPECT_EQ(station.count(kExperiments), 2) << at;
    EXPECT_EQ(station.count(kDesigns), 2) << at;
    EXPECT_EQ(station.count(kPush), 1) << at;
    EXPECT_LE(station.count(kJobs), 3) << at;  // a tuning that was at work is begun again
    const int before = station.requests;
    ASSERT_EQ(tune(), 0) << "what is done is shown again";
    EXPECT_LE(station.requests - before, 2) << at;
    EXPECT_THAT(out.str(), HasSubstr("1.77"));
  }
}

TEST_F(AutotuneTest, WhatNothingMeetsEndsWithAnOfferAndAnotherSpecificationGoesOnFromThere) {
  resume_from("tune.json");
  station.is_feasible = false;
  EXPECT_EQ(tune(), kNothingMeetsIt);
  EXPECT_THAT(out.str(), HasSubstr("not feasible: theta = 107 degrees"));
  EXPECT_THAT(out.str(), HasSubstr("iso-damped, nearest"));
  EXPECT_EQ(station.count(kPush), 0);
  station.is_feasible = true;
  options.request.crossover_rad_s = 6;
  EXPECT_EQ(tune(), 0) << progress.str();
  EXPECT_EQ(station.body_of(kJobs, 2)["crossover_rad_s"], 6.0);
  EXPECT_EQ(station.count(kExperiments), 2) << "the identification was not done again";
  options.request.crossover_rad_s = 7;
  EXPECT_THROW(tune(), std::runtime_error) << "a controller for 6 rad/s is on the robot";
}

TEST_F(AutotuneTest, AnAbortedExperimentEndsItWithTheReasonAndIsBegunAgainByTheNextCall) {
  resume_from("tune.json");
  station.experiment_ends[1] = "aborted";
  EXPECT_EQ(tune(), kStageEnded);
  EXPECT_THAT(progress.str(), HasSubstr("experiment 1 was aborted: position_sd_m is above 0.03"));
  EXPECT_EQ(station.count(kJobs), 0);
  EXPECT_EQ(tune(), 0) << progress.str();
  EXPECT_EQ(station.body_of(kJobs)["run_id"], 102) << "the run of the second one";
}

TEST_F(AutotuneTest, AJobThatFailsAndAControllerThatIsNotReportedEndIt) {
  station.job_end = "failed";
  EXPECT_EQ(tune(), kStageEnded);
  EXPECT_THAT(progress.str(), HasSubstr("model: job 1 failed: duty is 0 throughout"));
  EXPECT_EQ(station.count(kDesigns), 0);
  station = {};
  station.is_verified = false;
  EXPECT_EQ(tune(), kStageEnded);
  EXPECT_THAT(progress.str(), HasSubstr("push: the robot accepted the controller and has not reported it"));
  EXPECT_EQ(station.count(kExperiments), 1) << "nothing moves with a controller that is not verified";
}

TEST_F(AutotuneTest, ARunTakesThePlaceOfTheExperiment) {
  options.request.run = 12;
  options.request.fit_to_s = 30;
  options.search.sensor_lag_s = 0.01;
  options.search.longest_dead_time_s = 0.1;
  options.search.tries_dead_time = false;
  options.request.mu = 0.9;
  options.request.confirm = true;
  station.controller = nullptr;
  ASSERT_EQ(tune(), 0);
  EXPECT_EQ(station.count(kExperiments), 1);
  EXPECT_EQ(station.body_of(kJobs), (json{{"kind", "identify"},
                                          {"run_id", 12},
                                          {"cut_at_gaps", true},
                                          {"to_s", 30.0},
                                          {"dead_time_s", 0.1},
                                          {"sensor_lag_s", 0.01}}));
  EXPECT_FALSE(station.body_of(kJobs, 1).contains("duty_min")) << "the robot's range is not known";
  EXPECT_EQ(station.body_of(kJobs, 1)["mu"], 0.9);
  EXPECT_EQ(station.body_of(kPush)["confirm"], true);
}

TEST_F(AutotuneTest, AFileOfAnotherAutotuneIsRefused) {
  resume_from("tune.json");
  ASSERT_EQ(tune(), 0);
  options.request.robot_id = "sim-2";
  try {
    tune();
    FAIL() << "it went on with another robot";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("goes on from an autotune with robot_id \"sim-1\", not \"sim-2\""));
  }
  save("broken.json", "{\"version\": 1");
  resume_from("broken.json");
  EXPECT_THROW(tune(), std::runtime_error);
  EXPECT_EQ(station.count(kPush), 1);
}

TEST_F(AutotuneTest, AProfileMayBeADocument) {
  save("mine.json", R"({"name":"mine","step":[{"kind":"rest","for_s":3}]})");
  options.profile = (folder_ / "mine.json").string();
  ASSERT_EQ(tune(), 0);
  EXPECT_THAT(station.body_of(kExperiments)["profile"].get<std::string>(), HasSubstr(R"("name":"mine")"));
  EXPECT_FALSE(station.body_of(kJobs).contains("to_s")) << "the halves of the shipped set are not those of any profile";
  options.profile = (folder_ / "none.json").string();
  EXPECT_THROW(tune(), std::runtime_error);
}

TEST_F(AutotuneTest, AProfileMayBeAFileInToml) {
  save("mine.toml", "version = 1\nname = \"mine\"\n");
  options.profile = (folder_ / "mine.toml").string();
  ASSERT_EQ(tune(), 0);
  EXPECT_EQ(station.body_of(kExperiments)["profile"], "version = 1\nname = \"mine\"\n\n");
}

TEST_F(ToolTest, AutotuneRefusesBadOptions) {
  const auto said = [this](const char* options) { return ask(std::string{"autotune "} + options).error; };
  EXPECT_THAT(said("--crossover-rad-s 3 --phase-margin-deg 90"), HasSubstr("--robot is required"));
  EXPECT_THAT(said("--robot sim-1 --crossover-rad-s 0 --phase-margin-deg 90"), HasSubstr("--crossover-rad-s must be"));
  EXPECT_THAT(said("--robot sim-1 --crossover-rad-s 3 --phase-margin-deg 180"), HasSubstr("from 0.1 to 179.9"));
  EXPECT_THAT(said("--robot sim-1 --crossover-rad-s 3 --phase-margin-deg 90 --run 1 --profile figure_5"),
              HasSubstr("excludes"));
  EXPECT_THAT(said("--robot sim-1 --crossover-rad-s 3 --phase-margin-deg 90 --data @none"),
              HasSubstr("there is no folder"));
}

}  // namespace
}  // namespace server::cli
