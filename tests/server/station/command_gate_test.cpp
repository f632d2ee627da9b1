// The envelope: ranges, steps of the setpoint, time at power, and the limits of a fluid.
#include "server/station/command_gate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace server {
namespace {

using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

class CommandGateTest : public ::testing::Test {
 protected:
  CommandGateTest() {
    robot.id = "nemo";
    robot.sample_period_us = 10'000;
    robot.sample = Sample{.position_m = 0.1F};
    robot.fluid = "non_newtonian";
    CommandLimits water, oil;
    water.setpoint_step_m = 0.05;
    water.duty_max = 0.5;
    oil.setpoint_min_m = 0;
    oil.duty_max = 0.8;
    oil.power_duty = 0.3;
    oil.power_s = 10;
    envelope = Envelope{{}, {{"water", water}, {"oil", oil}}};
  }

  static protocol::Command setpoint(float setpoint_m) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_setpoint_tag;
    command.action.set_setpoint.setpoint_m = setpoint_m;
    return command;
  }
  static protocol::Command automatic(float setpoint_m) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_mode_tag;
    command.action.set_mode.mode = rheonaut_MODE_AUTO;
    command.action.set_mode.has_setpoint_m = true;
    command.action.set_mode.setpoint_m = setpoint_m;
    return command;
  }
  static protocol::Command duty(float duty) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_tag;
    command.action.set_duty.duty = duty;
    return command;
  }
  static protocol::Command renewal() {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_renew_lease_tag;
    return command;
  }
  static protocol::Command schedule(std::initializer_list<std::pair<std::uint32_t, float>> steps) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_schedule_tag;
    auto& into = command.action.set_duty_schedule;
    for (const auto& [tick, value] : steps) {
      into.tick[into.tick_count++] = tick;
      into.duty[into.duty_count++] = value;
    }
    return command;
  }

  // What speaks against the command: its reason and its sentence; empty when nothing does.
  std::string refusal(const protocol::Command& command) const {
    const auto checked = check_command(command, robot, envelope);
    return checked ? "" : checked.error().reason + ": " + checked.error().detail;
  }

  Envelope envelope;
  RobotState robot;
};

TEST_F(CommandGateTest, ValuesOutsideTheirRangeAreRefusedWithTheLimit) {
  EXPECT_EQ(refusal(setpoint(0.9F)), "");
  EXPECT_THAT(refusal(setpoint(1.1F)), HasSubstr("out_of_range: setpoint_m = 1.1"));
  EXPECT_THAT(refusal(setpoint(1.1F)), HasSubstr("is outside -1 to 1"));
  EXPECT_THAT(refusal(setpoint(kNan)), HasSubstr("out_of_range"));
  EXPECT_THAT(refusal(automatic(-1.1F)), HasSubstr("out_of_range"));
  EXPECT_THAT(refusal(duty(kNan)), HasSubstr("out_of_range"));
  EXPECT_THAT(refusal(schedule({{0, 0.2F}, {10, -1.2F}, {20, 0}})), HasSubstr("duty = -1.2"));
}

TEST_F(CommandGateTest, AStepOfTheSetpointCountsFromTheSetpointInForceElseFromThePosition) {
  CommandLimits limits;
  limits.setpoint_step_m = 0.2;
  envelope = Envelope{limits};
  EXPECT_EQ(refusal(setpoint(0.3F)), "") << "just the limit, from the position";
  EXPECT_THAT(refusal(automatic(0.31F)), HasSubstr("step_too_large: setpoint_m = 0.31"));
  EXPECT_THAT(refusal(automatic(0.31F)), HasSubstr("is 0.210 m from the position 0.100; a step is at most 0.2 m"));
  robot.context.mode = rheonaut_MODE_AUTO;
  robot.context.setpoint_m = 0.5F;
  EXPECT_EQ(refusal(setpoint(0.7F)), "");
  EXPECT_THAT(refusal(setpoint(0.2F)), HasSubstr("from the setpoint 0.500"));
  robot.context.mode = rheonaut_MODE_MANUAL;
  EXPECT_EQ(refusal(automatic(0.2F)), "") << "a setpoint of an auto mode that has ended is in force no more";
  robot.sample.reset();
  EXPECT_EQ(refusal(automatic(0.9F)), "") << "nothing is known of where it is";
}

TEST_F(CommandGateTest, TheMotorIsNotCommandedBeyondItsTimeAtPower) {
  robot.at_power_s = 60;
  EXPECT_EQ(refusal(duty(1)), "") << "just the limit";
  robot.at_power_s = 60.01;
  EXPECT_THAT(refusal(duty(1)),
              HasSubstr("too_long_at_power: duty = 1 is above 0.9, where robot 'nemo' has run for 60.0 s"));
  EXPECT_THAT(refusal(duty(-0.95F)), HasSubstr("the limit is 60 s"));
  EXPECT_EQ(refusal(duty(0.9F)), "");
  EXPECT_EQ(refusal(renewal()), "") << "of a duty that is not at power";
  robot.sample->duty = 1;
  EXPECT_THAT(refusal(renewal()), HasSubstr("too_long_at_power"));
}

TEST_F(CommandGateTest, AScheduleBringsItsOwnTimeAtPower) {
  robot.at_power_s = 58;
  EXPECT_EQ(refusal(schedule({{0, 1}, {100, 0.5F}, {200, -1}, {300, 0}})), "") << "2 s at power";
  EXPECT_THAT(refusal(schedule({{0, 1}, {100, 0.5F}, {200, -1}, {301, 0}})), HasSubstr("too_long_at_power"));
}

TEST_F(CommandGateTest, AFluidHasItsOwnLimits) {
  EXPECT_EQ(refusal(automatic(0.2F)), "");
  robot.fluid = "water";
  EXPECT_THAT(refusal(automatic(0.2F)), HasSubstr("a step is at most 0.05 m (limits of the fluid 'water')"));
  EXPECT_THAT(refusal(duty(0.6F)), HasSubstr("is outside -1 to 0.5 (limits of the fluid 'water')"));
  robot.fluid = "oil";
  EXPECT_EQ(refusal(duty(0.6F)), "");
  EXPECT_THAT(refusal(duty(0.9F)), HasSubstr("is outside -1 to 0.8 (limits of the fluid 'oil')"));
}

TEST_F(CommandGateTest, WhereTheFluidIsNotKnownTheStrictestOfAllLimitsHold) {
  for (const char* unknown : {"", "blood", "Water"}) {
    robot.fluid = unknown;
    EXPECT_THAT(refusal(duty(0.6F)),
                HasSubstr("is outside -1 to 0.5 (the robot's fluid is not known, so the strictest limits"));
    EXPECT_THAT(refusal(setpoint(-0.01F)), HasSubstr("is outside 0 to 1 (the robot's fluid")) << "of oil";
    EXPECT_THAT(refusal(setpoint(0.2F)), HasSubstr("a step is at most 0.05 m (the robot's fluid")) << "of water";
    robot.at_power_s = 20;
    EXPECT_THAT(refusal(duty(0.4F)), HasSubstr("is above 0.3, where robot")) << "of oil";
    robot.at_power_s = 0;
    EXPECT_EQ(refusal(duty(0.4F)), "");
  }
}

TEST(Envelope, TheLooserLimitsOfAFluidNeverHoldWhereItIsNotKnown) {
  CommandLimits strict, loose;
  strict.duty_max = 0.2;
  strict.setpoint_max_m = 0.5;
  const Envelope envelope{strict, {{"oil", loose}}};
  EXPECT_EQ(envelope.strictest(), strict);
  EXPECT_EQ(envelope.in("oil"), loose);
  EXPECT_EQ(envelope.in("water"), strict) << "a built-in fluid without limits of its own";
}

TEST(Envelope, AnUnknownFluidIsRefusedWithTheList) {
  const Envelope envelope{{}, {{"oil", {}}}};
  EXPECT_EQ(envelope.listed(" Oil ").value(), "oil");
  EXPECT_EQ(envelope.listed("NON_Newtonian").value(), "non_newtonian");
  EXPECT_EQ(envelope.listed("").value(), "");
  for (const char* wrong : {"watr", "non newtonian", " ", "\n", "0123456789012345678901234567890123456789x"}) {
    const auto refused = envelope.listed(wrong);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_EQ(refused.error().reason, "unknown_fluid");
    EXPECT_THAT(refused.error().detail, HasSubstr("is none of non_newtonian, oil, water; a section [fluids.NAME]"));
  }
}

TEST_F(CommandGateTest, NoMotionPassesALatchAndNoClearAStopOnItsWay) {
  robot.context.emergency_id = 5;
  EXPECT_THAT(refusal(duty(0.1F)), HasSubstr("latched"));
  EXPECT_THAT(refusal(automatic(0.1F)), HasSubstr("latched"));
  protocol::Command clear = rheonaut_Command_init_zero;
  clear.which_action = rheonaut_Command_clear_emergency_tag;
  EXPECT_EQ(refusal(clear), "");
  robot.pending_stop = 1;
  EXPECT_THAT(refusal(clear), HasSubstr("stop_pending"));
}

}  // namespace
}  // namespace server
