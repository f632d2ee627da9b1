// `predict --run`: a recorded step beside the step of a loop that is named.
#include <gmock/gmock.h>

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
