// A switch cuts the motor's supply: the robot stops with it, and goes on only when a person has cleared that.
#include <gtest/gtest.h>

#include "sim_robot/lab/station_commands.hpp"
#include "tests/robot_fw/bare_core.hpp"

namespace robot_fw {
namespace {

class MotorSupply : public ::testing::Test {
 protected:
  std::string clear() {
    const auto ack = core.order(sim_robot::clear_emergency(core.robot.emergency_id()));
    return ack.result == rheonaut_COMMAND_RESULT_REJECTED ? protocol::text(ack.reason) : protocol::text(ack.result);
  }
  void cut(bool is_cut) {
    core.motor_supply_is_cut = is_cut;
    core.tick();
  }

  BareCore core;
};

TEST_F(MotorSupply, ThatIsCutStopsTheRobotInTheSameTickWithACauseOfItsOwn) {
  core.order(sim_robot::set_duty(0.4F));
  core.tick();
  ASSERT_NE(core.robot.duty(), 0);
  cut(true);
  EXPECT_EQ(core.robot.duty(), 0);
  EXPECT_STREQ(protocol::text(core.robot.emergency_cause()), "motor_supply_cut");
  EXPECT_EQ(core.sample.emergency_cause, rheonaut_EMERGENCY_CAUSE_MOTOR_SUPPLY_CUT);
  ASSERT_FALSE(core.events.empty());
  EXPECT_EQ(core.events.back().kind, rheonaut_EVENT_KIND_EMERGENCY);
  EXPECT_STREQ(protocol::text(core.events.back().cause), "motor_supply");
}

// SAFETY: releasing the button starts nothing.
TEST_F(MotorSupply, ThatComesBackMovesNothing) {
  core.order(sim_robot::set_auto(0.5F));
  core.run(5);
  ASSERT_NE(core.robot.duty(), 0);
  cut(true);
  core.run(100);
  cut(false);
  for (int i = 0; i < 100; ++i) {
    core.tick();
    ASSERT_EQ(core.robot.duty(), 0);
  }
  EXPECT_EQ(core.robot.mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(clear(), "accepted");
  core.run(10);
  EXPECT_EQ(core.robot.duty(), 0) << "a clear leaves it at rest";
  EXPECT_EQ(core.robot.mode(), rheonaut_MODE_MANUAL);
}

TEST_F(MotorSupply, IsNotClearedWhileItIsCut) {
  cut(true);
  EXPECT_EQ(clear(), "cause_stands");
  cut(false);
  EXPECT_EQ(clear(), "accepted");
  cut(true);
  EXPECT_EQ(core.robot.mode(), rheonaut_MODE_EMERGENCY) << "each time anew";
}

TEST_F(MotorSupply, ThatIsCutInAnotherEmergencyLeavesItsCauseAndKeepsItFromBeingCleared) {
  core.order(sim_robot::emergency_stop());
  cut(true);
  EXPECT_STREQ(protocol::text(core.robot.emergency_cause()), "operator");
  EXPECT_EQ(clear(), "cause_stands");
  cut(false);
  EXPECT_EQ(clear(), "accepted");
}

}  // namespace
}  // namespace robot_fw
