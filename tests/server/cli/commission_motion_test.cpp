// What the commissioning of a robot finds while its motor runs, from robots that are sound and robots that are not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/cli/commission/motion.hpp"
#include "server/cli/commission/plan.hpp"
#include "server/cli/commission/robot_access.hpp"
#include "server/cli/commission/travel.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

// A robot that follows the duty with a lag of 80 ms and 0.1 m/s per duty, above a dead zone.
std::vector<RecordedSample> driven(const json& profile, double gain, double dead_zone, double noise,
                                   bool has_reverse = true) {
  constexpr double kTick = 0.01, kLag = 0.08;
  std::mt19937 random{3};
  std::normal_distribution<double> normal{0, noise};
  std::vector<RecordedSample> samples;
  double velocity = 0;
  for (const json& step : profile.at("step")) {
    const double duty = step.value("duty", 0.0), way = has_reverse ? duty : std::abs(duty);
    const double driven_duty = std::abs(duty) < dead_zone ? 0 : way;
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
  EXPECT_EQ(seen.edges(), 2);
  EXPECT_NEAR(seen.velocity_m_s, 0.1 * 0.2 * (1 - std::exp(-0.25 / 0.08)), 4 * seen.sd_m_s);
  EXPECT_TRUE(seen.is_seen());
  EXPECT_LT(pushed(-0.1).velocity_m_s, 0);
  EXPECT_FALSE(pushed(0).is_seen());
  auto samples = driven(direction_profile(kPlan), 0.1, 0, 0.012);
  samples.erase(samples.begin() + 60);  // in the window of the first edge
  const Response one_edge = responses_of(samples, 0.012).back();
  EXPECT_EQ(one_edge.rising, 0);
  EXPECT_EQ(one_edge.falling, 1);
}

TEST(CommissionMotion, SaysNothingOfTheAxisWhereAnEdgeIsMissing) {
  auto samples = driven(direction_profile(kPlan), 0, 0, 0.012);  // an axis across the tube
  for (RecordedSample& sample : samples) sample.acceleration_m_s2 -= 0.02;
  samples.erase(samples.begin() + 60);
  const Response biased = responses_of(samples, 0.012).back();
  ASSERT_TRUE(biased.is_seen()) << "the bias looks like motion";
  const StepFinding finding = judge_imu_axis({biased, SeenByPerson::forwards});
  EXPECT_EQ(finding.verdict, Verdict::not_done);
  EXPECT_THAT(finding.found, HasSubstr("samples are missing"));
  EXPECT_EQ(judge_imu_axis({{.duty = 0.2}, SeenByPerson::forwards}).verdict, Verdict::not_done) << "no edge at all";
}

TEST(CommissionMotion, BlamesTheAxisOnlyWhereTheNoiseIsLowEnoughToSeeMotion) {
  Response none = pushed(0);
  EXPECT_EQ(judge_imu_axis({none, SeenByPerson::forwards}).verdict, Verdict::fail);
  const StepFinding failed = judge_imu_axis({none, SeenByPerson::forwards, false});
  EXPECT_EQ(failed.verdict, Verdict::not_done) << "the noise failed before";
  none.sd_m_s *= 4;
  const StepFinding hidden = judge_imu_axis({none, SeenByPerson::forwards});
  EXPECT_EQ(hidden.verdict, Verdict::not_done);
  EXPECT_EQ(hidden.found, "the noise hides it");
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

DeadZoneFacts dead_zone_facts(double dead_zone, double parameter) {
  DeadZoneFacts facts;
  facts.responses = responses_of(driven(pushes_profile(kPlan), 0.1, dead_zone, 0.012), 0.012);
  facts.parameter = parameter;
  return facts;
}
StepFinding dead_zone_of(double dead_zone, double parameter) {
  return judge_dead_zone(dead_zone_facts(dead_zone, parameter));
}

TEST(CommissionMotion, FindsTheDeadZoneBetweenTwoDuties) {
  EXPECT_EQ(dead_zone_of(0, 0).verdict, Verdict::pass);
  const StepFinding unknown = dead_zone_of(0.08, 0);
  EXPECT_EQ(unknown.verdict, Verdict::attention);
  EXPECT_EQ(unknown.figures.at("forwards").at("still_at"), 0.06);
  EXPECT_EQ(unknown.figures.at("backwards").at("moves_at"), 0.1);
  EXPECT_EQ(dead_zone_of(0.08, 0.08).verdict, Verdict::pass) << "one that the robot knows";
  const auto to_set = dead_zone_to_set(dead_zone_facts(0.08, 0));
  ASSERT_TRUE(to_set);
  EXPECT_EQ(to_set->still, 0.06);
  EXPECT_EQ(to_set->moving, 0.1);
  EXPECT_FALSE(dead_zone_to_set(dead_zone_facts(0.08, 0.08)));
  EXPECT_FALSE(dead_zone_to_set(dead_zone_facts(0.9, 0))) << "where nothing moves";
  EXPECT_EQ(dead_zone_of(0.9, 0).verdict, Verdict::fail) << "a motor that does not turn";
}

TEST(CommissionMotion, FindsAReverseThatDrivesForwards) {
  DeadZoneFacts facts;
  facts.responses = responses_of(driven(pushes_profile(kPlan), 0.1, 0, 0.012, false), 0.012);
  facts.tried = duties_in(pushes_profile(kPlan));
  const StepFinding finding = judge_dead_zone(facts);
  EXPECT_EQ(finding.verdict, Verdict::fail);
  EXPECT_THAT(finding.found, HasSubstr("the reverse does not reverse"));
}

TEST(CommissionMotion, JudgesNoDeadZoneWhereSamplesAreMissing) {
  auto samples = driven(pushes_profile(kPlan), 0.1, 0, 0.012);
  std::erase_if(samples, [](const RecordedSample& one) { return one.duty == 0.3; });
  DeadZoneFacts facts;
  facts.responses = responses_of(samples, 0.012);
  facts.tried = duties_in(pushes_profile(kPlan));
  EXPECT_EQ(facts.tried, 10);
  const StepFinding finding = judge_dead_zone(facts);
  EXPECT_EQ(finding.verdict, Verdict::not_done);
  EXPECT_THAT(finding.found, HasSubstr("samples are missing: 9 of 10"));
}

// With a rising edge less, an error of the bias looks like motion.
TEST(CommissionMotion, JudgesNoDeadZoneByOneEdgeOfAPush) {
  DeadZoneFacts facts;
  facts.responses = responses_of(driven(pushes_profile(kPlan), 0.1, 0, 0.012), 0.012);
  facts.tried = duties_in(pushes_profile(kPlan));
  facts.responses.back().rising -= 1;
  EXPECT_EQ(judge_dead_zone(facts).verdict, Verdict::not_done);
}

// SAFETY: a step that the station repeats takes the robot further than the way that somebody has looked at.
TEST(CommissionMotion, NoticesARepeatedStep) {
  EXPECT_FALSE(has_repeated_step({{"steps", {{{"step", 1}}, {{"step", 2}}}}}));
  EXPECT_TRUE(has_repeated_step({{"steps", {{{"step", 1}}, {{"step", 2}}, {{"step", 2}}}}}));
}

TEST(CommissionMotion, TakesOnlyTheRobotsOwnWordForARefusedDuty) {
  const json record{{"state", "rejected"}, {"reason", "out_of_range"}};
  const auto answer = [](int status, const json& body) {
    StationAnswer given;
    given.status = status;
    given.body = body;
    return given;
  };
  EXPECT_EQ(duty_answer(answer(409, {{"reason", "out_of_range"}, {"command", record}})), DutyAnswer::refused_by_robot);
  EXPECT_EQ(duty_answer(answer(200, {{"state", "verified"}})), DutyAnswer::taken);
  EXPECT_EQ(duty_answer(answer(422, {{"reason", "out_of_range"}})), DutyAnswer::refused_by_station);
  EXPECT_EQ(duty_answer(answer(401, {{"reason", "no_token"}})), DutyAnswer::none);
  EXPECT_EQ(duty_answer(answer(409, {{"command", {{"state", "rejected"}, {"reason", "latched"}}}})), DutyAnswer::none);
}

TEST(CommissionMotion, WantsAMotorWithoutReverseToRefuseBackwards) {
  CommissionPlan plan;
  plan.is_one_way = true;
  DeadZoneFacts facts;
  facts.responses = responses_of(driven(pushes_profile(plan), 0.1, 0, 0.012), 0.012);
  facts.is_one_way = true;
  facts.backwards = DutyAnswer::refused_by_robot;
  EXPECT_EQ(judge_dead_zone(facts).verdict, Verdict::pass);
  EXPECT_THAT(judge_dead_zone(facts).found, HasSubstr("without reverse"));
  facts.backwards = DutyAnswer::taken;
  EXPECT_EQ(judge_dead_zone(facts).verdict, Verdict::fail);
  facts.backwards = DutyAnswer::refused_by_station;
  EXPECT_EQ(judge_dead_zone(facts).verdict, Verdict::attention) << "the robot was not asked, and need not be";
  facts.backwards = DutyAnswer::none;
  EXPECT_EQ(judge_dead_zone(facts).verdict, Verdict::not_done) << "nobody asked the robot";
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

TEST(CommissionMotion, APositionOfUnknownUncertaintyIsNotCertain) {
  json row{
      {"robot_time_us", 1},  {"position_m", 0.1}, {"position_sd_m", nullptr}, {"acceleration_m_s2", 0}, {"duty", 0},
      {"impedance_mv", 500}, {"flags", 0}};
  EXPECT_EQ(sample_in(row).position_sd_m, std::nullopt);
  row["position_sd_m"] = 0.002;
  EXPECT_EQ(sample_in(row).position_sd_m, 0.002);
  EXPECT_EQ(sum_of(0.002, std::nullopt), std::nullopt);
  EXPECT_EQ(sum_of(0.002, 0.001), 0.003);
}

TEST(CommissionMotion, HoldsTheRobotsLimitsAgainstTheRulers) {
  TravelFacts facts{.ahead_m = 0.5, .behind_m = 0.4, .limit_min_m = -0.3, .limit_max_m = 0.4};
  facts.believed_m = 0.02;
  facts.believed_sd_m = 0.001;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::pass);
  EXPECT_THAT(judge_free_travel(facts).action, HasSubstr("zero its position"));
  facts.zero_m = 0.11;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::attention) << "its zero has moved 11 cm ahead";
  facts.zero_m = -0.11;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::attention) << "or back";
  facts.zero_m = 0;
  facts.zero_sd_m = 0.06;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::attention) << "or nobody knows where it is";
  facts.zero_sd_m = std::nullopt;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::attention)
      << "nor where the robot does not say how certain it is";
  EXPECT_EQ(judge_free_travel(facts).figures.at("zero_sd_m"), nullptr);
  EXPECT_THAT(judge_free_travel(facts).found, HasSubstr("its zero lies at +0 mm, ± not known of the start"));
  facts.zero_sd_m = 0;
  facts.measured_m = 0.023;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::pass) << "within 2 sd and the ruler's own error";
  facts.measured_m = 0.03;
  EXPECT_THAT(judge_free_travel(facts).action, HasSubstr("believes a wrong way"));
  facts.measured_m.reset();
  facts.limit_max_m = 100;
  EXPECT_THAT(judge_free_travel(facts).action, HasSubstr("position_limit_max_m=0.39 and position_limit_min_m=-0.31"));
  facts.limit_max_m = 0.4;
  facts.gain_m_s = 0.35;
  facts.worst_stop_ms = 500;
  EXPECT_EQ(judge_free_travel(facts).verdict, Verdict::attention) << "17 cm until a stop arrives";
}

}  // namespace
}  // namespace server::cli
