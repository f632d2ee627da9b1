// `predict --run`: a recorded step beside the step of a loop that is named.
#include <gmock/gmock.h>

#include "server/api/bodies/controller_body.hpp"
#include "tests/server/cli/run_tools_fixture.hpp"

namespace server {
namespace {

using cli::ToolAnswer;
using ::testing::HasSubstr;

TEST_F(RunTools, PredictRepeatsTheRunsStepAndDisturbance) {
  robot_.controller_checksum = 0;  // not known
  begin();
  robot_.context.mode = rheonaut_MODE_AUTO;
  robot_.context.setpoint_m = 0.2F;
  swim(300, 0.3);
  robot_.context.disturbance_m = -0.05F;
  swim(200, 0.3);
  flush();
  const ToolAnswer answer = ask("predict --run 1 --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  const auto json = answer.json();
  EXPECT_NEAR(json["experiment"]["setpoint_m"], 0.2, 1e-6);
  EXPECT_NEAR(json["experiment"]["disturbance_m"], -0.05, 1e-6);
  EXPECT_NEAR(json["experiment"]["disturbance_at_s"], 3, 1e-6);
  EXPECT_NEAR(json["experiment"]["duration_s"], 4.99, 1e-6);
  EXPECT_EQ(json["measured_steps"].size(), 2u);
  const std::string text = ask("predict --run 1").text;
  EXPECT_THAT(text, HasSubstr("setpoint 0 to 0.2 m, measured"));
  const std::string with =
      "plant (29) of the paper, controller (30) of the paper, duty -1 to 1; if the run had others, give --plant and "
      "--controller; the run's duty was never below 0: if its motor turns one way only, give --duty-min 0";
  EXPECT_THAT(text, HasSubstr("\npredicted with: " + with + "\n\n"));
  EXPECT_EQ(json["predicted_with"], with);
  EXPECT_THAT(ask("predict --run 1 --plant newtonian --duty-min 0").text,
              HasSubstr("predicted with: plant newtonian, controller (30) of the paper, duty 0 to 1; if the run had "
                        "others, give --plant and --controller\n\n"));
}

TEST_F(RunTools, PredictSaysWhetherTheRunBeganWithItsController) {
  const auto predicted = cli::ask_tool(folder_, "predict --json").json();
  EXPECT_EQ(predicted["run_controller_checksum"], nullptr) << "there is no run";
  robot_.controller_checksum = predicted["controller_checksum"].get<std::uint32_t>();
  begin();
  robot_.context.mode = rheonaut_MODE_AUTO;
  robot_.context.setpoint_m = 0.2F;
  swim(300, 0.3);
  flush();
  const auto same = ask("predict --run 1 --json").json();
  EXPECT_EQ(same["run_controller_checksum"], robot_.controller_checksum);
  EXPECT_EQ(same["controller_checksum"], robot_.controller_checksum);
  EXPECT_THAT(same["predicted_with"].get<std::string>(), HasSubstr("; the run began with this controller (checksum "));
  const auto other = ask("predict --run 1 --duty-min 0 --json").json();
  EXPECT_EQ(other["run_controller_checksum"], robot_.controller_checksum);
  EXPECT_NE(other["controller_checksum"], robot_.controller_checksum) << "a motor that turns one way only";
  EXPECT_THAT(ask("predict --run 1 --duty-min 0").text,
              HasSubstr(fmt::format("; the run began with ANOTHER controller: its checksum is {:08x}, that of the "
                                    "prediction {:08x}, so coefficients, period, duty range or derivative differ\n",
                                    robot_.controller_checksum, other["controller_checksum"].get<std::uint32_t>())));
}

TEST_F(RunTools, PredictTakesTheControllerThatTheRunHad) {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.controller_id = 7;
  controller.period_us = 20'000;
  controller.kp = controller.direct = 2;
  controller.duty_min = 0;
  controller.duty_max = 0.625F;
  controller.checksum = robot_.controller_checksum = api::checksum_of(controller);
  begin();
  recorder_->on_in_force(station::RobotState{},
                         {.boot_id = robot_.boot_id, .is_change = false, .first_seq = 0, .content = controller});
  robot_.context.mode = rheonaut_MODE_AUTO;
  robot_.context.setpoint_m = 0.2F;
  swim(300, 0.3);
  flush();
  const auto predicted = ask("predict --run 1 --json").json();
  EXPECT_EQ(predicted["controller_checksum"], controller.checksum);
  EXPECT_EQ(predicted["sections"]["direct"], 2);
  EXPECT_EQ(predicted["period_s"], 0.02);
  EXPECT_EQ(predicted["method"], nullptr);
  EXPECT_EQ(predicted["experiment"]["duty_min"], 0);
  EXPECT_EQ(predicted["experiment"]["duty_max"], 0.625);
  EXPECT_NEAR(predicted["duty"][0], 0.4, 1e-6) << "2 of a step of 0.2 m";
  EXPECT_EQ(
      predicted["predicted_with"],
      fmt::format("plant (29) of the paper, the run's controller 7 (checksum {:08x}), duty 0 to 0.625; if the run "
                  "had another plant, give --plant",
                  controller.checksum));
  EXPECT_EQ(ask("predict --run 1 --json --duty-max 0.5").json()["experiment"]["duty_max"], 0.5);
  std::ofstream{folder_ / "named.json"} << R"({"kp": 29.971237, "kd": 0.10523527, "mu": 0.94550043})";
  const auto named = ask("predict --run 1 --json --controller @named.json").json();
  EXPECT_NE(named["controller_checksum"], controller.checksum);
  EXPECT_THAT(named["predicted_with"].get<std::string>(), HasSubstr("ANOTHER controller"));
}

TEST_F(RunTools, PredictDoesNotCallAPositionKnownWhoseUncertaintyIsNot) {
  begin();
  robot_.context.mode = rheonaut_MODE_AUTO;
  robot_.context.setpoint_m = 0.2F;
  robot_.context.position_sd_m = std::nullopt;
  swim(300, 0.3);
  flush();
  const std::string text = ask("predict --run 1").text;
  EXPECT_THAT(text, HasSubstr("compared with: the robot's own estimate (position_sd_m is not known)\n"));
  EXPECT_THAT(text, HasSubstr(" ± not known"));
}

TEST_F(RunTools, PredictNeedsAStepInTheRun) {
  begin();
  swim(50, 0.3);
  flush();
  EXPECT_THAT(ask("predict --run 1").error, HasSubstr("no step"));
}

}  // namespace
}  // namespace server
