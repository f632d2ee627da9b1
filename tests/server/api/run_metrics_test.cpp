// Metrics of runs: the figures of a record, what is kept, and several runs side by side.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <random>

#include "base/version.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/analysis/metrics/repeatability.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using analysis::RunPoint;
using ::testing::ElementsAre;

RunPoint point_at(std::uint64_t seq, float duty = 0, std::uint32_t flags = 0) {
  RunPoint point;
  point.step.seq = seq;
  point.step.robot_time_us = 1'000'000 + seq * 10'000;
  point.step.position_m = 0.001F * static_cast<float>(seq);
  point.step.position_sd_m = 0.002F;
  point.duty = duty;
  point.flags = flags;
  return point;
}

double figure(const std::vector<RunPoint>& points, const std::string& wanted, const storage::Run& run = {}) {
  for (const auto& [name, value] : run_figures(points, run)) {
    if (name == wanted) return value.value_or(-1);
  }
  return -2;
}

TEST(RunFigures, CountWhatIsThereAndWhatIsNot) {
  std::vector<RunPoint> points;
  for (std::uint64_t seq = 0; seq < 100; ++seq) points.push_back(point_at(seq));
  for (std::uint64_t seq = 150; seq < 200; ++seq) points.push_back(point_at(seq));
  storage::Run run;
  run.samples_expected = 200;
  run.samples_lost = 40;
  EXPECT_NEAR(figure(points, "duration_s", run), 1.5, 1e-9);
  EXPECT_EQ(figure(points, "samples_expected", run), 200);
  EXPECT_EQ(figure(points, "samples_stored", run), 150);
  EXPECT_EQ(figure(points, "samples_lost", run), 40);
  EXPECT_EQ(figure(points, "gaps"), 1);
  EXPECT_NEAR(figure(points, "longest_gap_s"), 0.51, 1e-9);
  EXPECT_NEAR(figure(points, "position_range_m"), 0.199, 1e-6);
  EXPECT_NEAR(figure(points, "position_sd_max_m"), 0.002, 1e-9);
}

TEST(RunFigures, ARebootIsNoGap) {
  std::vector<RunPoint> points;
  for (std::uint64_t seq = 0; seq < 10; ++seq) points.push_back(point_at(seq));
  points.push_back(point_at(500));
  points.back().step.span = 1;
  EXPECT_EQ(figure(points, "gaps"), 0);
}

TEST(RunFigures, TheTimeAtPowerEndsWithAGap) {
  std::vector<RunPoint> points;
  for (std::uint64_t seq = 0; seq < 30; ++seq) points.push_back(point_at(seq, -0.95F));
  for (std::uint64_t seq = 40; seq < 60; ++seq) points.push_back(point_at(seq, 1));
  for (std::uint64_t seq = 60; seq < 100; ++seq) points.push_back(point_at(seq, 0.9F));
  EXPECT_NEAR(figure(points, "longest_at_power_s"), 0.3, 1e-9);
  EXPECT_EQ(figure(points, "driven_share"), 1);
}

TEST(RunFigures, SharesAreThoseOfTheFlags) {
  std::vector<RunPoint> points;
  for (std::uint64_t seq = 0; seq < 10; ++seq) {
    points.push_back(point_at(seq, 0.5F, seq < 3 ? rheonaut_TELEMETRY_FLAG_SENSOR_FAULT : 0));
    points.back().is_latched = seq == 9;
  }
  EXPECT_NEAR(figure(points, "sensor_fault_share"), 0.3, 1e-12);
  EXPECT_NEAR(figure(points, "latched_share"), 0.1, 1e-12);
  EXPECT_NEAR(figure(points, "duty_rms"), 0.5, 1e-9);
  EXPECT_EQ(figure(points, "resent_share"), 0);
}

TEST(RunFigures, OfARunWithoutSamplesSayNothing) {
  EXPECT_EQ(figure({}, "duration_s"), 0);
  EXPECT_EQ(figure({}, "duty_rms"), -1) << "none";
  EXPECT_EQ(figure({}, "position_range_m"), -1);
}

// A loop on the estimate settles in its own belief.
TEST(PositionDoubt, IsThatOfAPositionLessExactThanTheBand) {
  const auto said = [](const char* source, const json& sd_m) {
    json metrics{{"steps", {{{"position_source", source}, {"position_sd_m", sd_m}, {"band_m", 0.002}}}}};
    analysis::add_position_doubts(metrics);
    return metrics["steps"][0]["position_doubt"].get<std::string>();
  };
  EXPECT_EQ(said("known", 0), "");
  EXPECT_EQ(said("estimate", 0.001), "") << "± 2 sd are the band";
  EXPECT_EQ(said("estimate", 0.03), "± 60 mm is 30 times the band of 2.0 mm: this shows the belief only");
  EXPECT_EQ(said("estimate", 0.2), "± 400 mm is 200 times the band of 2.0 mm: this shows the belief only");
  EXPECT_EQ(said("outside", 0.002), "± 4.0 mm is 2.0 times the band of 2.0 mm: this shows no settling within it");
  EXPECT_EQ(said("estimate", nullptr), "how exact the position is, is not known: this shows the belief only");
}

TEST(Repeatability, IsThatOfIso5725) {
  const std::vector<std::optional<double>> values{1.0, 2.0, std::nullopt, 3.0};
  const auto result = analysis::repeatability_of(values);
  EXPECT_EQ(result.runs, 3U);
  EXPECT_EQ(result.mean, 2);
  EXPECT_EQ(result.sd, 1);
  EXPECT_NEAR(result.confidence_half_width.value(), 2.4841, 1e-4) << "t(0.975; 2) = 4.3027, over the root of 3";
  EXPECT_NEAR(result.repeatability_limit.value(), 6.0849, 1e-4) << "t(0.975; 2), times the root of 2";
  EXPECT_FALSE(analysis::repeatability_of({values.begin(), 1}).sd);
  EXPECT_FALSE(analysis::repeatability_of({values.begin() + 2, 1}).mean);
}

TEST(Repeatability, OfTwoFurtherRuns95PercentDifferByLessThanTheLimitHoweverFewItIsFrom) {
  std::mt19937_64 random{20261130};
  std::normal_distribution<double> runs{1.8, 0.04};
  for (const std::size_t repeats : {2U, 3U, 5U, 30U}) {
    constexpr int kTrials = 20'000;
    int held = 0;
    for (int i = 0; i < kTrials; ++i) {
      std::vector<std::optional<double>> values(repeats);
      for (auto& value : values) value = runs(random);
      held += std::abs(runs(random) - runs(random)) <= analysis::repeatability_of(values).repeatability_limit.value();
    }
    EXPECT_NEAR(static_cast<double>(held) / kTrials, 0.95, 0.006) << repeats << " repeats";
  }
}

class RunMetricsTest : public ApiTest {
 protected:
  void record(std::uint64_t first_seq, int samples, const json& more = json::object()) {
    json body{{"robot_id", "r1"}, {"name", fmt::format("from {}", first_seq)}};
    body.update(more);
    const Answered made = ask("POST", "/api/v1/runs", body);
    ASSERT_EQ(made.status, 201) << made.body;
    for (int seq = 0; seq < samples; seq += 25) {
      make_samples(*robot, first_seq + static_cast<std::uint64_t>(seq), 25);
      clock.run_for(250ms);
    }
    ASSERT_EQ(ask("POST", fmt::format("/api/v1/runs/{}/end", made.parsed()["run_id"].get<int>())).status, 200);
  }
};

TEST_F(RunMetricsTest, AreComputedOnceAndKeptWithTheirVersion) {
  connect_robot();
  record(0, 200);
  const json first = ask("GET", "/api/v1/runs/1/metrics").parsed();
  EXPECT_EQ(first["figures"]["samples_stored"], 200);
  EXPECT_EQ(first["version"], analysis::kMetricsVersion);
  EXPECT_EQ(first["program"], base::version());
  EXPECT_EQ(first["is_kept"], true);
  clock.run_for(5s);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/metrics").parsed(), first) << "not computed again";
  EXPECT_EQ(ask("GET", "/api/v1/runs/2/metrics").status, 404);
}

TEST_F(RunMetricsTest, AreComputedAgainWhenThePositionIsMeasuredFromOutside) {
  connect_robot();
  record(0, 200);
  const json first = ask("GET", "/api/v1/runs/1/metrics").parsed();
  EXPECT_EQ(first["estimate_error"], nullptr);
  std::string csv = "t_s,position_m\n";
  for (int k = 0; k < 50; ++k) csv += fmt::format("{},{}\n", k / 30.0, 0.001 * k);
  const json reference{{"csv", csv},
                       {"source", "camera"},
                       {"sd_m", 0.0005},
                       {"keep_zero", true},
                       {"clock", {{"method", "offset"}, {"offset_s", 0.01}}}};
  const Answered imported = ask("POST", "/api/v1/runs/1/reference", reference);
  ASSERT_EQ(imported.status, 201) << imported.body;
  EXPECT_NE(ask("GET", "/api/v1/runs/1/metrics").parsed()["estimate_error"], nullptr);
}

TEST_F(RunMetricsTest, ThoseOfAnOpenRunAreNotKept) {
  connect_robot();
  ASSERT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "open"}}).status, 201);
  make_samples(*robot, 0, 25);
  clock.run_for(2s);
  const json open = ask("GET", "/api/v1/runs/1/metrics").parsed();
  EXPECT_EQ(open["is_kept"], false);
  make_samples(*robot, 25, 25);
  clock.run_for(2s);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/metrics").parsed()["figures"]["samples_stored"], 50);
}

TEST_F(RunMetricsTest, SeveralRunsStandSideBySide) {
  connect_robot();
  record(0, 200);
  record(200, 300, {{"tube", "narrow"}});
  const json compared = ask("GET", "/api/v1/run-comparison?runs=1,2").parsed();
  EXPECT_EQ(compared["runs"][1]["name"], "from 200");
  EXPECT_THAT(compared["differing_conditions"], ElementsAre("tube"));
  const auto is_duration = [](const json& row) { return row["name"] == "duration_s"; };
  const auto duration = std::ranges::find_if(compared["figures"], is_duration);
  ASSERT_NE(duration, compared["figures"].end());
  EXPECT_NEAR((*duration)["mean"].get<double>(), 2.5, 1e-9);
  EXPECT_NEAR((*duration)["sd"].get<double>(), std::sqrt(0.5), 1e-9);
  for (const char* wrong : {"", "?runs=1", "?runs=1,x", "?runs=1,,2", "?runs=0,1"}) {
    EXPECT_EQ(ask("GET", std::string{"/api/v1/run-comparison"} + wrong).status, 400) << wrong;
  }
  EXPECT_EQ(ask("GET", "/api/v1/run-comparison?runs=1,9").status, 404);
}

TEST(MetricsComparison, StepsAreThoseThatAllRunsHaveWithTheSameCause) {
  const auto step = [](const char* cause, json settling_s, double position_sd_m = 0.0005) {
    return json{{"cause", cause},  {"position_source", "estimate"}, {"position_sd_m", position_sd_m},
                {"band_m", 0.002}, {"settling_s", settling_s},      {"overshoot_percent", 0},
                {"peak_m", 0.1},   {"rise_10_90_s", nullptr},       {"steady_state_error_m", 0}};
  };
  const std::vector<storage::Run> runs(2);
  const std::vector<json> documents{
      {{"figures", {{"gaps", 0}}}, {"steps", {step("setpoint", 1.0), step("disturbance", 2.0), step("setpoint", 9)}}},
      {{"figures", {{"gaps", 2}}}, {"steps", {step("setpoint", 1.5, 0.03), step("disturbance", nullptr)}}}};
  const json compared = analysis::comparison_json(runs, documents);
  ASSERT_EQ(compared["steps"].size(), 2U);
  EXPECT_EQ(compared["steps"][0]["measures"][0]["name"], "settling_s");
  EXPECT_EQ(compared["steps"][0]["measures"][0]["mean"], 1.25);
  EXPECT_EQ(compared["steps"][1]["measures"][0]["runs"], 1) << "one never settled";
  for (const char* name : {"mean", "sd", "confidence_half_width", "repeatability_limit"}) {
    EXPECT_TRUE(compared["steps"][1]["measures"][0][name].is_null()) << name << " of those that settled is too good";
  }
  EXPECT_THAT(compared["steps"][0]["position_source"], ElementsAre("estimate", "estimate"));
  EXPECT_THAT(compared["steps"][0]["position_doubt"],
              ElementsAre("", "± 60 mm is 30 times the band of 2.0 mm: this shows the belief only"));
  EXPECT_EQ(compared["figures"][0]["mean"], 1);
  EXPECT_TRUE(compared["differing_conditions"].empty());
}

}  // namespace
}  // namespace server
