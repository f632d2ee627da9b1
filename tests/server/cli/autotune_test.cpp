// The chain of autotune against a station that is played: what is asked in which order, what is not done twice, and how
// each stage may end.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "tests/server/cli/autotune_fixture.hpp"

namespace server::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(AutotuneTest, AsksForEachStageInOrderAndComparesAtTheEnd) {
  ASSERT_EQ(tune(), 0) << progress.str();
  std::vector<std::string> order;
  for (const auto& [target, body] : station.posted) order.push_back(target);
  EXPECT_THAT(order, ElementsAre(kExperiments, kJobs, kDesigns, kJobs, kDesigns, kPush, kRobotModel, kExperiments));
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
  const json sent = station.body_of(kRobotModel)["model"];
  EXPECT_EQ(sent["model_gain_m_s"], (json{1, 2, 3, 4}));
  EXPECT_EQ(sent["plant"], (json{{"kp", 0.1}}));
  EXPECT_EQ(sent["doubts"][0]["code"], "residuals_not_white") << "the station judges by them";
  EXPECT_THAT(progress.str(), HasSubstr("robot model: confirmed, read back bit for bit"));
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
