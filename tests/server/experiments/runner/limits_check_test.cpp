// Profiles against the station's limits; the longest time in auto; the prediction that is stored.
#include "server/experiments/limits_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "server/analysis/tuning/robot_controller.hpp"
#include "server/experiments/preview.hpp"
#include "server/experiments/profile_document.hpp"
#include "server/experiments/runner/order_arguments.hpp"
#include "server/experiments/runner/prediction.hpp"

namespace server::experiments {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

Profile profile_of(const std::string& toml) { return parse_profile("name = \"a\"\npurpose = \"b\"\n" + toml, "test"); }

TEST(CheckLimits, NamesTheStepAndTheLimit) {
  config::CommandLimits narrow;
  narrow.duty_max = 0.4;
  narrow.setpoint_step_m = 0.3;
  narrow.disturbance_max_m = 0.02;
  const config::Envelope envelope{{}, {{"water", narrow}}};
  const auto problem = [&envelope](const std::string& toml, const std::string& fluid) {
    const auto checked = check_limits(profile_of(toml), envelope, fluid);
    return checked ? "" : checked.error().detail;
  };
  const std::string duty = "[[step]]\nkind = \"rest\"\nfor_s = 1\n[[step]]\nkind = \"duty\"\nduty = 0.5\nfor_s = 1\n";
  EXPECT_EQ(problem(duty, "non_newtonian"), "");
  EXPECT_THAT(problem(duty, "water"), HasSubstr("step 2: duty = 0.5 is outside -1 to 0.4"));
  EXPECT_THAT(problem(duty, ""), HasSubstr("step 2")) << "SAFETY: where the fluid is not known the strictest hold";
  EXPECT_THAT(problem("[conditions]\nfluid = \"water\"\n" + duty, "non_newtonian"), HasSubstr("step 2"));
  EXPECT_THAT(problem("[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.5\nfor_s = 1\n", "water"),
              HasSubstr("0.500 m from"));
  EXPECT_THAT(problem("[[step]]\nkind = \"disturbance\"\ndisturbance_m = 0.05\nfor_s = 1\n", "water"),
              HasSubstr("disturbance_m = 0.05"));
  EXPECT_THAT(problem("[conditions]\nfluid = \"honey\"\n" + duty, ""), HasSubstr("honey"));
}

TEST(RobotLimits, OfADutyAreThoseOfItsMotor) {
  const auto problem_of = [](const char* toml, const RobotLimits& limits) {
    const auto allowed = check_demands(demands_of(profile_of(toml)), limits);
    return allowed ? std::string{} : allowed.error().detail;
  };
  const char* const prbs =
      "[[step]]\nkind = \"rest\"\nfor_s = 1\n[[step]]\nkind = \"prbs\"\namplitude = 0.3\nmean_duty = 0.2\nbit_s = "
      "0.2\nfor_s = 5\n";
  EXPECT_EQ(problem_of(prbs, {}), "");
  EXPECT_THAT(problem_of(prbs, {.has_reverse = false}),
              HasSubstr("step 2: duty = -0.1, and the robot's controller has"));
  const char* const setpoints =
      "[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.7\nfor_s = 3\n[[step]]\nkind = \"setpoint\"\nsetpoint_m = -0.2\n"
      "for_s = 3\n";
  EXPECT_EQ(problem_of(setpoints, {.setpoint_max_m = 0.7F}), "") << "0.7 is a float for the robot, too";
  EXPECT_THAT(problem_of(setpoints, {.setpoint_max_m = 0.5F}),
              HasSubstr("step 1: setpoint_m = 0.7 is outside -inf to 0.5 m, the limits of the robot"));
  EXPECT_THAT(problem_of(setpoints, {.setpoint_min_m = -0.1F}), HasSubstr("step 2: setpoint_m = -0.2 is outside -0.1"));
  EXPECT_EQ(problem_of(setpoints, {.has_reverse = false}), "") << "a closed loop is clamped";
  const std::string disturbed =
      std::string{setpoints} + "[[step]]\nkind = \"disturbance\"\ndisturbance_m = -0.2\nfor_s = 2\n";
  EXPECT_EQ(problem_of(disturbed.c_str(), {.disturbance_max_m = 0.2F}), "");
  EXPECT_THAT(problem_of(disturbed.c_str(), {.disturbance_max_m = 0.1F}), HasSubstr("step 3: a disturbance of 0.2 m"));
  const std::string twice = "[conditions]\nstart = \"back\"\n[sweep]\nrepeats = 2\n" + std::string{prbs};
  EXPECT_THAT(problem_of(twice.c_str(), {.auto_limit_s = 10}), HasSubstr("stays in auto for 15.0 s"));
}

TEST(LongestAuto, IsTheLongestStretchOfAllRuns) {
  const std::string steps =
      "[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 3\n[[step]]\nkind = \"disturbance\"\ndisturbance_m = "
      "0.01\nfor_s = 2\n[[step]]\nkind = \"rest\"\nfor_s = 9\n[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0\nfor_s = "
      "4\n";
  EXPECT_NEAR(longest_auto_s(profile_of(steps)), 5, 1e-9);
}

TEST(Prediction, IsThatOfThePreviewWithTheControllerOfTheRobot) {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.kp = 5;
  controller.pole_count = controller.residue_count = 1;
  controller.pole[0] = 0.5F;
  controller.residue[0] = 0.25F;
  controller.direct = 100;  // the robot corrects it
  controller.duty_min = -1;
  controller.duty_max = 1;
  EXPECT_NEAR(control::dc_gain(analysis::sections_of(controller)), 5, 1e-9);
  const Profile profile = profile_of("[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 30\n");
  PredictionRequest request{profile, time_line_of(profile, {}), control::kNonNewtonianModel, "(29)", {}, controller};
  const json told = json::parse(prediction_json(request));
  EXPECT_EQ(told["model_of"], "(29)");
  EXPECT_EQ(told["position_sd_m"], nullptr);
  EXPECT_EQ(told["position_sd_parts_m"], nullptr);
  EXPECT_LE(told["t_s"].size(), kMostPredicted);
  EXPECT_EQ(told["t_s"].size(), told["position_m"].size());
  const Preview preview = preview_of(profile, request.line, request.model, analysis::sections_of(controller));
  EXPECT_DOUBLE_EQ(told["position_m"].back().get<double>(), preview.position_m[preview.position_m.size() - 1]);
}

// docs/protocol.md: u = direct e + Σ residue x + Σ (b0 w₁ + b1 w₂), each section a sample late.
std::vector<double> duties_of_robot(const protocol::Controller& controller, std::size_t count) {
  double direct = controller.kp;
  for (pb_size_t i = 0; i < controller.pole_count; ++i) direct -= controller.residue[i] / (1.0 - controller.pole[i]);
  for (pb_size_t i = 0; i < controller.biquad_b0_count; ++i) {
    direct -= (static_cast<double>(controller.biquad_b0[i]) + controller.biquad_b1[i]) /
              (1.0 + controller.biquad_a1[i] + controller.biquad_a2[i]);
  }
  std::vector<double> x(controller.pole_count), w1(controller.biquad_b0_count), w2(controller.biquad_b0_count), duties;
  for (std::size_t k = 0; k < count; ++k) {
    const double error = k == 0 ? 1 : 0;
    double duty = direct * error;
    for (std::size_t i = 0; i < x.size(); ++i) {
      duty += controller.residue[i] * x[i];
      x[i] = controller.pole[i] * x[i] + error;
    }
    for (std::size_t i = 0; i < w1.size(); ++i) {
      duty += controller.biquad_b0[i] * w1[i] + controller.biquad_b1[i] * w2[i];
      const double next = error - controller.biquad_a1[i] * w1[i] - controller.biquad_a2[i] * w2[i];
      w2[i] = w1[i];
      w1[i] = next;
    }
    duties.push_back(duty);
  }
  return duties;
}

TEST(Prediction, RunsTheControllerAsTheRobotDoes) {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.kp = 30;
  controller.pole_count = controller.residue_count = 3;
  const float poles[] = {0.5F, -0.25F, 0}, residues[] = {2.5F, -4, 3};
  std::ranges::copy(poles, controller.pole);
  std::ranges::copy(residues, controller.residue);
  controller.biquad_b0_count = controller.biquad_b1_count = controller.biquad_a1_count = controller.biquad_a2_count = 3;
  const float b0[] = {1, 2, -1}, b1[] = {-0.5F, 3, 0}, a1[] = {-1.2F, 0, 0.3F}, a2[] = {0.45F, 0, 0};
  std::ranges::copy(b0, controller.biquad_b0);
  std::ranges::copy(b1, controller.biquad_b1);
  std::ranges::copy(a1, controller.biquad_a1);
  std::ranges::copy(a2, controller.biquad_a2);
  control::SectionFilter filter{analysis::sections_of(controller)};
  const std::vector<double> duties = duties_of_robot(controller, 50);
  for (std::size_t k = 0; k < duties.size(); ++k) EXPECT_NEAR(filter.step(k == 0 ? 1 : 0), duties[k], 1e-6) << k;
}

TEST(Prediction, HasItsBandWithEachPartWhereModelAndRobotAreKnown) {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.kp = 5;
  controller.duty_min = -1;
  controller.duty_max = 1;
  const Profile profile = profile_of("[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 30\n");
  control::ExpectedUncertainty known;
  known.one_sigma[0] = 0.001;
  PredictionRequest request{profile,   time_line_of(profile, {}), control::kNonNewtonianModel, "water", known,
                            controller};
  EXPECT_EQ(json::parse(prediction_json(request))["position_sd_m"], nullptr) << "the robot's parameters are not known";
  EXPECT_FALSE(estimate_of(station::ParameterTable{}));
  request.estimate.emplace().gain_m_s[0] = 0.1;
  const json told = json::parse(prediction_json(request));
  double variance_m2 = 0;
  for (const char* part : {"parameters", "estimator", "sensor", "start"}) {
    variance_m2 += std::pow(told["position_sd_parts_m"][part].at(100).get<double>(), 2);
  }
  EXPECT_NEAR(told["position_sd_m"].at(100).get<double>(), std::sqrt(variance_m2), 1e-12);
  EXPECT_GT(told["true_position_sd_m"].back().get<double>(), told["position_sd_m"].back().get<double>());
}

TEST(OrderArguments, AreThoseOfTheBody) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_mode_tag;
  command.action.set_mode.mode = rheonaut_MODE_AUTO;
  command.action.set_mode.setpoint_m = 0.1F;
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = 12;
  EXPECT_EQ(arguments_of(command), R"({"execute_at_robot_us":12,"mode":"auto","setpoint_m":0.1})");
}

}  // namespace
}  // namespace server::experiments
