// What the commissioning of a robot finds, from facts that are good and facts that are not; its plan and its record.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/cli/commission/motion.hpp"
#include "server/cli/commission/plan.hpp"
#include "server/cli/commission/record.hpp"
#include "server/cli/commission/standstill.hpp"
#include "server/runtime/sha256.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

std::vector<double> noise_of(double mean, double sd, std::size_t count = 500) {
  std::mt19937 random{7};
  std::normal_distribution<double> normal{mean, sd > 0 ? sd : 1};
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(sd > 0 ? normal(random) : mean);
  return values;
}

RestFacts at_rest() {
  RestFacts facts;
  facts.acceleration_m_s2 = noise_of(0, 0.012);
  facts.impedance_mv = noise_of(176, 1);
  return facts;
}

Verdict imu_with(double mean, double sd) {
  RestFacts facts = at_rest();
  facts.acceleration_m_s2 = noise_of(mean, sd);
  return judge_imu_noise(facts).verdict;
}

StepFinding electrode_with(double mean, double sd) {
  RestFacts facts = at_rest();
  facts.impedance_mv = noise_of(mean, sd);
  return judge_electrode(facts);
}

TEST(CommissionStops, PassOnlyWhenEachIsConfirmed) {
  StopFacts facts{3, {4.0, 2.0, 9.0}, "", 1.5};
  const StepFinding good = judge_stops(facts);
  EXPECT_EQ(good.verdict, Verdict::pass);
  EXPECT_EQ(good.figures.at("median_ms"), 4.0);
  EXPECT_EQ(good.figures.at("worst_ms"), 9.0);
  facts.confirmed_ms[1] = 251;
  EXPECT_EQ(judge_stops(facts).verdict, Verdict::attention);
  facts.asked = 4;
  facts.not_confirmed = "stop 4 is not: the robot has not answered";
  const StepFinding bad = judge_stops(facts);
  EXPECT_EQ(bad.verdict, Verdict::fail);
  EXPECT_THAT(bad.found, HasSubstr("3 of 4 stops confirmed; stop 4 is not"));
  EXPECT_EQ(judge_stops({}).verdict, Verdict::fail);
  EXPECT_EQ(judge_stops({2, {1.0, 1.0}, "the emergency was not reset", {}}).verdict, Verdict::fail);
}

TEST(CommissionVersions, WantOneVersionAndACalibratedSensor) {
  VersionFacts facts{"sim-0.9.0", "0.9.0", "0.9.0", "power_on", 3, true};
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::pass);
  facts.imu_calibration = 1;
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::attention);
  facts = {"0.8.0", "0.9.0", "0.9.0", "power_on", 3, true};
  EXPECT_THAT(judge_versions(facts).action, HasSubstr("flash"));
  facts = {"0.9.0", "0.9.0", "0.9.0", "watchdog", 3, true};
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::attention);
}

TEST(CommissionAtRest, JudgesTheNoiseByWhatTheEstimatorAssumes) {
  EXPECT_EQ(imu_with(0, 0.012), Verdict::pass);
  EXPECT_EQ(imu_with(0, 0.025), Verdict::attention);
  EXPECT_EQ(imu_with(0, 0.06), Verdict::fail);
  EXPECT_EQ(imu_with(0, 0), Verdict::fail) << "a sensor that is stuck";
  EXPECT_EQ(imu_with(0.02, 0.012), Verdict::attention) << "a bias that the robot has not found";
  RestFacts facts = at_rest();
  facts.has_sensor_fault = true;
  EXPECT_EQ(judge_imu_noise(facts).verdict, Verdict::fail);
  facts = at_rest();
  facts.acceleration_m_s2.resize(100);
  EXPECT_EQ(judge_imu_noise(facts).verdict, Verdict::fail);
}

TEST(CommissionAtRest, JudgesTheElectrodeByTheBandOfTheMonitor) {
  EXPECT_EQ(electrode_with(176, 1).verdict, Verdict::pass);
  EXPECT_THAT(electrode_with(176, 15).found, HasSubstr("noisy"));
  EXPECT_EQ(electrode_with(176, 15).verdict, Verdict::fail);
  EXPECT_EQ(electrode_with(176, 6).verdict, Verdict::attention);
  EXPECT_THAT(electrode_with(3, 1).found, HasSubstr("open"));
  EXPECT_THAT(electrode_with(1023, 1).found, HasSubstr("saturated"));
  EXPECT_THAT(electrode_with(220, 1).action, HasSubstr("impedance_nominal_mv to 220"));
  EXPECT_EQ(electrode_with(175, 0).verdict, Verdict::attention) << "a reading that never changes";
}

// A robot that follows the duty with a lag of 80 ms and 0.1 m/s per duty, above a dead zone.
std::vector<RecordedSample> driven(const json& profile, double gain, double dead_zone, double noise) {
  constexpr double kTick = 0.01, kLag = 0.08;
  std::mt19937 random{3};
  std::normal_distribution<double> normal{0, noise};
  std::vector<RecordedSample> samples;
  double velocity = 0;
  for (const json& step : profile.at("step")) {
    const double duty = step.value("duty", 0.0), driven_duty = std::abs(duty) < dead_zone ? 0 : duty;
    for (int i = 0; i < std::lround(step.at("for_s").get<double>() / kTick); ++i) {
      const double acceleration = (gain * driven_duty - velocity) / kLag;
      RecordedSample sample;
      sample.robot_time_us = static_cast<std::int64_t>(samples.size()) * 10'000;
      sample.duty = duty;
      sample.acceleration_m_s2 = acceleration + normal(random);
      velocity += acceleration * kTick;
      samples.push_back(sample);
    }
  }
  return samples;
}

const CommissionPlan kPlan;

Response pushed(double gain) { return responses_of(driven(direction_profile(kPlan), gain, 0, 0.012), 0.012).back(); }

TEST(CommissionMotion, SeesAPushInTheAccelerationAndNoneWhereThereIsNone) {
  const Response seen = pushed(0.1);
  EXPECT_EQ(seen.duty, 0.2);
  EXPECT_EQ(seen.edges, 2);
  EXPECT_NEAR(seen.velocity_m_s, 0.1 * 0.2 * (1 - std::exp(-0.25 / 0.08)), 4 * seen.sd_m_s);
  EXPECT_TRUE(seen.is_seen());
  EXPECT_LT(pushed(-0.1).velocity_m_s, 0);
  EXPECT_FALSE(pushed(0).is_seen());
  auto samples = driven(direction_profile(kPlan), 0.1, 0, 0.012);
  samples.erase(samples.begin() + 60);  // in the window of the first edge
  EXPECT_EQ(responses_of(samples, 0.012).back().edges, 1);
}

TEST(CommissionMotion, TellsAReversedMotorFromASensorThatIsTheWrongWayRound) {
  struct Case {
    double gain;  // as the accelerometer sees it
    SeenByPerson person;
    Verdict motor, axis;
  };
  const Case cases[] = {{0.1, SeenByPerson::forwards, Verdict::pass, Verdict::pass},
                        {-0.1, SeenByPerson::forwards, Verdict::pass, Verdict::fail},
                        {-0.1, SeenByPerson::backwards, Verdict::fail, Verdict::pass},
                        {0.1, SeenByPerson::backwards, Verdict::fail, Verdict::fail},
                        {0, SeenByPerson::forwards, Verdict::pass, Verdict::fail},
                        {0, SeenByPerson::backwards, Verdict::fail, Verdict::fail},
                        {0, SeenByPerson::nothing, Verdict::fail, Verdict::not_done}};
  for (const Case& one : cases) {
    const DirectionFacts facts{pushed(one.gain), one.person};
    EXPECT_EQ(judge_motor_direction(facts).verdict, one.motor) << one.gain;
    EXPECT_EQ(judge_imu_axis(facts).verdict, one.axis) << one.gain;
  }
  EXPECT_THAT(judge_imu_axis({pushed(0), SeenByPerson::forwards}).found, HasSubstr("lies across the tube"));
  EXPECT_THAT(judge_imu_axis({pushed(-0.1), SeenByPerson::forwards}).found, HasSubstr("wrong way round"));
}

StepFinding dead_zone_of(double dead_zone, double parameter) {
  DeadZoneFacts facts;
  facts.responses = responses_of(driven(pushes_profile(kPlan), 0.1, dead_zone, 0.012), 0.012);
  facts.parameter = parameter;
  return judge_dead_zone(facts);
}

TEST(CommissionMotion, FindsTheDeadZoneBetweenTwoDuties) {
  EXPECT_EQ(dead_zone_of(0, 0).verdict, Verdict::pass);
  const StepFinding unknown = dead_zone_of(0.08, 0);
  EXPECT_EQ(unknown.verdict, Verdict::attention);
  EXPECT_EQ(unknown.figures.at("forwards").at("still_at"), 0.06);
  EXPECT_EQ(unknown.figures.at("backwards").at("moves_at"), 0.1);
  EXPECT_EQ(dead_zone_of(0.08, 0.08).verdict, Verdict::pass) << "one that the robot knows";
  EXPECT_EQ(dead_zone_of(0.9, 0).verdict, Verdict::fail) << "a motor that does not turn";
}

TEST(CommissionMotion, WantsAMotorWithoutReverseToRefuseBackwards) {
  CommissionPlan plan;
  plan.is_one_way = true;
  DeadZoneFacts facts;
  facts.responses = responses_of(driven(pushes_profile(plan), 0.1, 0, 0.012), 0.012);
  facts.is_one_way = facts.has_refused_backwards = true;
  EXPECT_EQ(judge_dead_zone(facts).verdict, Verdict::pass);
  EXPECT_THAT(judge_dead_zone(facts).found, HasSubstr("without reverse"));
  facts.has_refused_backwards = false;
  EXPECT_EQ(judge_dead_zone(facts).verdict, Verdict::fail);
}

json fit_of(double gain, double sigma, double b1, double b2) {
  return {{"parameters", {{"kp", gain}, {"b1", b1}, {"b2", b2}, {"b3", 1}}},
          {"one_sigma", {{"kp", sigma}, {"b1", 8e-5}, {"b2", 2e-3}}},
          {"correlation_of", {"kp", "b1", "b2"}},
          {"correlation", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
          {"residuals_are_white", true},
          {"end", "converged"},
          {"fit_percent", 80}};
}

TEST(CommissionMotion, GivesTheLagsOfTheNewtonianModel) {
  const StepFinding found = judge_motor_constant({fit_of(232 / 667.1, 0.001, 1 / 667.1, 60.13 / 667.1), ""});  // (28)
  EXPECT_EQ(found.verdict, Verdict::pass);
  EXPECT_NEAR(found.figures.at("lags_s").at(0).get<double>(), 0.0220, 2e-4);  // (27)
  EXPECT_NEAR(found.figures.at("lags_s").at(1).get<double>(), 0.0682, 2e-4);
  // dτ/db1 = 1/√(b2² - 4 b1) and dτ/db2 = (1 - b2/√(…))/2 of the shorter one.
  const double root = std::sqrt(std::pow(60.13 / 667.1, 2) - 4 / 667.1);
  const double sigma = std::hypot(8e-5 / root, 2e-3 * (1 - 60.13 / 667.1 / root) / 2);
  EXPECT_NEAR(found.figures.at("lag_sigmas_s").at(0).get<double>(), sigma, 0.02 * sigma);
}

TEST(CommissionMotion, DoubtsAFitThatSaysLittle) {
  EXPECT_EQ(judge_motor_constant({fit_of(0.1, 0.05, 0.0017, 0.09), ""}).verdict, Verdict::attention);
  EXPECT_EQ(judge_motor_constant({fit_of(-0.1, 0.001, 0.0017, 0.09), ""}).verdict, Verdict::fail);
  EXPECT_THAT(judge_motor_constant({fit_of(0.1, 0.001, 0.01, 0.09), ""}).found, HasSubstr("not told apart"));
  const StepFinding failed = judge_motor_constant({nullptr, "a gap"});
  EXPECT_EQ(failed.verdict, Verdict::fail);
  EXPECT_THAT(failed.found, HasSubstr("a gap"));
}

TEST(CommissionMotion, HoldsTheRobotsLimitsAgainstTheRulers) {
  TravelFacts facts{.ahead_m = 0.5, .behind_m = 0.4, .limit_min_m = -0.3, .limit_max_m = 0.4};
  facts.believed_m = 0.02;
  facts.believed_sd_m = 0.001;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::pass);
  facts.measured_m = 0.023;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::pass) << "within 2 sd and the ruler's own error";
  facts.measured_m = 0.03;
  EXPECT_THAT(judge_free_travel(facts).action, HasSubstr("believes a wrong way"));
  facts.measured_m.reset();
  facts.limit_max_m = 100;
  EXPECT_THAT(judge_free_travel(facts).action, HasSubstr("position_limit_max_m=0.40 and position_limit_min_m=-0.32"));
  facts.limit_max_m = 0.4;
  facts.gain_m_s = 0.35;
  facts.worst_stop_ms = 500;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::attention) << "17 cm until a stop arrives";
}

TEST(CommissionPlan, BeginsSmallAndStaysWithinItsDuty) {
  for (const bool is_one_way : {false, true}) {
    const CommissionPlan plan{0.3, is_one_way};
    double largest_before = 0;
    for (const json& step : pushes_profile(plan).at("step")) {
      const double duty = step.value("duty", 0.0);
      EXPECT_LE(std::abs(duty), 0.3);
      if (is_one_way) EXPECT_GE(duty, 0);
      if (duty == 0) continue;
      EXPECT_GE(std::abs(duty), largest_before) << "the smallest first";
      largest_before = std::abs(duty);
    }
    for (const json& profile : {pushes_profile(plan), direction_profile(plan), steps_profile(plan)}) {
      EXPECT_LE(profile.at("limits").at("duty_max").get<double>(), 0.3);
      EXPECT_EQ(profile.at("step").back().at("kind"), "rest");
      EXPECT_LE(duration_of(profile), 20);
    }
  }
  EXPECT_NEAR(needed_m({0.3, false}), 0.4 * (0.3 * 0.3 + 0.2 + 0.3), 1e-9);
  EXPECT_NEAR(needed_m({0.3, true}), 0.4 * (2 * 0.3 * (0.03 + 0.06 + 0.1 + 0.2 + 0.3) + 0.2 + 4 * 0.3), 1e-9);
}

class CommissionRecordTest : public ToolTest {
 protected:
  CommissionRecordTest() {
    record_.robot_id = "rheo-1";
    record_.begun_at_us = 1'795'713'821'000'000;
    record_.ended_at_us = 1'795'713'881'000'000;
    record_.findings.push_back({.step = "stop_latency", .verdict = Verdict::pass, .found = "10 of 10 | confirmed"});
    record_.signed_by = "Ann";
  }
  std::string text_of(const std::filesystem::path& file) {
    std::ifstream in{file, std::ios::binary};
    return {std::istreambuf_iterator<char>{in}, {}};
  }
  CommissionRecord record_;
};

TEST_F(CommissionRecordTest, IsWrittenWithItsSumsAndNeverOverAnother) {
  const WrittenRecord written = write(record_, folder_);
  EXPECT_EQ(written.folder.filename(), "commission-rheo-1-20261126T172341Z");
  const std::string content = text_of(written.folder / "record.json");
  EXPECT_EQ(runtime::sha256_of(content), written.sha256);
  EXPECT_EQ(
      text_of(written.folder / "SHA256SUMS"),
      written.sha256 + "  record.json\n" + runtime::sha256_of(text_of(written.folder / "record.md")) + "  record.md\n");
  EXPECT_EQ(json::parse(content).at("signed_by"), "Ann");
  record_.signed_by = "Ben";
  EXPECT_THROW(write(record_, folder_), std::runtime_error);
  EXPECT_EQ(text_of(written.folder / "record.json"), content);
}

TEST_F(CommissionRecordTest, SaysWhyItIsNotSigned) {
  EXPECT_EQ(unsigned_reason(record_), "");
  EXPECT_STREQ(outcome_of(record_), "passed");
  record_.findings.push_back({.step = "electrode", .verdict = Verdict::attention});
  EXPECT_STREQ(outcome_of(record_), "passed_with_attention");
  record_.findings.push_back({.step = "imu_axis", .verdict = Verdict::fail});
  record_.findings.push_back(not_done("motor_constant", "not reached"));
  EXPECT_EQ(unsigned_reason(record_), "failed: imu_axis; not done: motor_constant");
  record_.ended_by = "interrupted";
  EXPECT_EQ(unsigned_reason(record_),
            "it ended before its end: interrupted; failed: imu_axis; not done: motor_constant");
  record_.unsigned_because = unsigned_reason(record_);
  record_.signed_by.clear();
  EXPECT_EQ(document_of(record_).at("outcome"), "not_passed");
  EXPECT_THAT(page_of(record_), HasSubstr("**Not signed**: it ended before its end"));
  EXPECT_THAT(page_of(record_), HasSubstr("10 of 10 \\| confirmed"));
}

TEST_F(CommissionRecordTest, RefusesAnswersThatAreNoneBeforeItBegins) {
  save("a.json", R"({"free_ahead_m": 1, "free_behind_m": -1, "direction": "forwards"})");
  EXPECT_THAT(ask("robot commission r --yes --answers @a.json").error, HasSubstr("free_behind_m must be a number"));
  save("a.json", R"({"direction": "sideways"})");
  EXPECT_THAT(ask("robot commission r --yes --answers @a.json").error,
              HasSubstr("one of forwards, backwards, nothing"));
  save("a.json", R"({"colour": "red"})");
  EXPECT_THAT(ask("robot commission r --yes --answers @a.json").error, HasSubstr("'colour' is no question"));
}

}  // namespace
}  // namespace server::cli
