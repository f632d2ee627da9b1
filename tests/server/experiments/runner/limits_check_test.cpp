// Profiles against the station's limits; the longest time in auto; the prediction that is stored.
#include "server/experiments/limits_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

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
  EXPECT_NEAR(control::dc_gain(sections_of(controller)), 5, 1e-9);
  const Profile profile = profile_of("[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 30\n");
  PredictionRequest request{profile, time_line_of(profile, {}), control::kNonNewtonianModel, "(29)", {}, controller};
  const json told = json::parse(prediction_json(request));
  EXPECT_EQ(told["model_of"], "(29)");
  EXPECT_EQ(told["position_sd_m"], nullptr);
  EXPECT_LE(told["t_s"].size(), kMostPredicted);
  EXPECT_EQ(told["t_s"].size(), told["position_m"].size());
  const Preview preview = preview_of(profile, request.line, request.model, sections_of(controller));
  EXPECT_DOUBLE_EQ(told["position_m"].back().get<double>(), preview.position_m[preview.position_m.size() - 1]);
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
