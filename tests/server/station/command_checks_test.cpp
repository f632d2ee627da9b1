// The envelope: ranges, steps of the setpoint, time at power, and the limits of a fluid.
#include "server/station/commands/command_checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <limits>

namespace server {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

class CommandChecksTest : public ::testing::Test {
 protected:
  CommandChecksTest() {
    robot.id = "nemo";
    robot.sample_period_us = 10'000;
    robot.sample = station::Sample{.position_m = 0.1F};
    robot.fluid = "non_newtonian";
    config::CommandLimits water, oil;
    water.setpoint_step_m = 0.05;
    water.duty_max = 0.5;
    oil.setpoint_min_m = 0;
    oil.duty_max = 0.8;
    oil.power_duty = 0.3;
    oil.power_s = 10;
    envelope = config::Envelope{{}, {{"water", water}, {"oil", oil}}};
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
    const auto checked = check_command(command, robot, envelope, ahead);
    return checked ? "" : checked.error().reason + ": " + checked.error().detail;
  }

  config::Envelope envelope;
  station::RobotState robot;
  station::OrdersAhead ahead;
};

TEST_F(CommandChecksTest, ValuesOutsideTheirRangeAreRefusedWithTheLimit) {
  EXPECT_EQ(refusal(setpoint(0.9F)), "");
  EXPECT_THAT(refusal(setpoint(1.1F)), HasSubstr("out_of_range: setpoint_m = 1.1"));
  EXPECT_THAT(refusal(setpoint(1.1F)), HasSubstr("is outside -1 to 1"));
  EXPECT_THAT(refusal(setpoint(kNan)), HasSubstr("out_of_range"));
  EXPECT_THAT(refusal(automatic(-1.1F)), HasSubstr("out_of_range"));
  EXPECT_THAT(refusal(duty(kNan)), HasSubstr("out_of_range"));
  EXPECT_THAT(refusal(schedule({{0, 0.2F}, {10, -1.2F}, {20, 0}})), HasSubstr("duty = -1.2"));
}

TEST_F(CommandChecksTest, AStepOfTheSetpointCountsFromTheSetpointInForceElseFromThePosition) {
  config::CommandLimits limits;
  limits.setpoint_step_m = 0.2;
  envelope = config::Envelope{limits};
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

// Of 0.2 m, with 0.1 in force; times count in seconds from now, the robot's 100 s.
class StepsTest : public CommandChecksTest {
 protected:
  StepsTest() {
    config::CommandLimits limits;
    limits.setpoint_step_m = 0.2;
    envelope = config::Envelope{limits};
    robot.context.mode = rheonaut_MODE_AUTO;
    robot.context.setpoint_m = 0.1F;
    robot.latest_robot_time_us = at_us(0);
  }
  static std::uint64_t at_us(double after_s) { return static_cast<std::uint64_t>((100 + after_s) * 1e6); }
  static protocol::Command in(double after_s, protocol::Command command, double life_s = 8) {
    command.has_execute_at_robot_us = after_s > 0;
    command.execute_at_robot_us = at_us(after_s);
    command.valid_until_robot_us = at_us(life_s);
    return command;
  }
  static protocol::Command now(protocol::Command command, double life_s = 1) { return in(0, command, life_s); }
  void held(const protocol::Command& command) {
    const std::uint64_t time_us = command.execute_at_robot_us;
    ahead.push_back({&commands_.emplace_back(command), time_us, time_us, true});
  }
  void on_its_way(const protocol::Command& command) {
    ahead.push_back(station::unanswered_order(commands_.emplace_back(command), at_us(0)));
  }

 private:
  std::deque<protocol::Command> commands_;
};

TEST_F(StepsTest, ASetpointNowKeepsAStepFromTheNextThatWaits) {
  held(in(5, setpoint(0.3F)));
  held(in(6, setpoint(0.5F)));
  EXPECT_EQ(refusal(now(setpoint(0.1F))), "") << "that of 0.5 comes after that of 0.3";
  EXPECT_THAT(refusal(now(setpoint(-0.1F))),
              HasSubstr("step_too_large: setpoint_m = -0.1 is 0.400 m from the setpoint 0.300 that waits for "
                        "execute_at_robot_us = 105000000; a step is at most 0.2 m; what waits is dropped by set_mode"));
  EXPECT_THAT(refusal(now(automatic(-0.1F))), HasSubstr("step_too_large")) << "in auto with a setpoint, too";
}

TEST_F(StepsTest, ASetpointThatIsToWaitFitsBetweenThoseBeforeAndAfterIt) {
  held(in(2, automatic(0.3F)));
  held(in(6, setpoint(0.1F)));
  EXPECT_EQ(refusal(in(4, setpoint(0.25F), 5)), "");
  EXPECT_THAT(refusal(in(4, setpoint(0.4F), 5)), HasSubstr("0.300 m from the setpoint 0.100 that waits"));
  EXPECT_THAT(refusal(in(4, setpoint(0.05F), 5)), HasSubstr("0.250 m from the setpoint 0.300 that waits"));
  EXPECT_THAT(refusal(in(1, setpoint(0.4F), 1.5)), HasSubstr("from the setpoint 0.100; a step"))
      << "from that in force";
  EXPECT_EQ(refusal(in(7, setpoint(-0.1F))), "") << "two steps from those at 2 s";
}

TEST_F(StepsTest, WhatMayComeLateKeepsAStepFromAllThatItMayMeet) {
  held(in(2, setpoint(0.2F)));
  held(in(5, setpoint(0.35F)));
  EXPECT_EQ(refusal(now(setpoint(0.05F), 1)), "");
  EXPECT_THAT(refusal(now(setpoint(0.05F), 3)), HasSubstr("from the setpoint 0.350 that waits"))
      << "it may come after 2 s";
}

TEST_F(StepsTest, WhatTheRobotHasNotAcknowledgedMayComeOrNot) {
  on_its_way(in(2, setpoint(0.3F)));
  EXPECT_THAT(refusal(in(4, setpoint(0.5F))), HasSubstr("from the setpoint 0.100; a step"));
  EXPECT_THAT(refusal(in(4, setpoint(0.05F))), HasSubstr("from the setpoint 0.300 that waits"));
  on_its_way(now(setpoint(0)));
  EXPECT_THAT(refusal(now(setpoint(0.25F))), EndsWith("from the setpoint 0.000 on its way; a step is at most 0.2 m"))
      << "no way out is told, for it waits for nothing";
}

TEST_F(CommandChecksTest, WhatWaitsCountsForTheTimeAtPower) {
  auto waiting = schedule({{0, 1}, {4000, 0}});
  auto duty_waiting = duty(1);
  duty_waiting.action.set_duty.lease_ms = 400;
  duty_waiting.has_execute_at_robot_us = waiting.has_execute_at_robot_us = true;
  ahead = {{&waiting, 1, 1, true}, {&duty_waiting, 2, 2, true}};
  EXPECT_EQ(refusal(schedule({{0, 1}, {1960, 0}})), "") << "40 s, 0.4 s and 19.6 s";
  EXPECT_THAT(
      refusal(schedule({{0, 1}, {1961, 0}})),
      HasSubstr("too_long_at_power: duty = 1 is above 0.9, where robot 'nemo' has run for 0.0 s, and what runs or "
                "waits for its time asks for 40.4 s more; the limit is 60 s"));
  robot.at_power_s = 19.7;
  EXPECT_THAT(refusal(duty(1)), HasSubstr("too_long_at_power"));
  EXPECT_EQ(refusal(duty(0.5F)), "");
  EXPECT_THAT(
      refusal(renewal()),
      HasSubstr("too_long_at_power: robot 'nemo' has run for 19.7 s above a duty of 0.9, and what runs or waits"));
  robot.at_power_s = 19.6;
  robot.sample->duty = 1;
  EXPECT_EQ(refusal(renewal()), "");
}

TEST_F(CommandChecksTest, WhatRunsCountsForTheTimeAtPowerAsFarAsItIsNotSampled) {
  auto running = schedule({{0, 1}, {4000, 0.5F}, {5000, 1}, {6000, 0}});
  ahead = {{&running, 1, 60'000'001, false, 39'000'000}};
  robot.at_power_s = 39;
  EXPECT_EQ(refusal(renewal()), "");
  EXPECT_EQ(refusal(schedule({{0, 1}, {1000, 0}})), "") << "39 s, 1 s and 10 s, and 10 s";
  EXPECT_THAT(refusal(schedule({{0, 1}, {1001, 0}})), HasSubstr("asks for 11.0 s more"));
}

TEST_F(CommandChecksTest, TheMotorIsNotCommandedBeyondItsTimeAtPower) {
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

TEST_F(CommandChecksTest, AScheduleBringsItsOwnTimeAtPower) {
  robot.at_power_s = 58;
  EXPECT_EQ(refusal(schedule({{0, 1}, {100, 0.5F}, {200, -1}, {300, 0}})), "") << "2 s at power";
  EXPECT_THAT(refusal(schedule({{0, 1}, {100, 0.5F}, {200, -1}, {301, 0}})), HasSubstr("too_long_at_power"));
}

TEST_F(CommandChecksTest, AFluidHasItsOwnLimits) {
  EXPECT_EQ(refusal(automatic(0.2F)), "");
  robot.fluid = "water";
  EXPECT_THAT(refusal(automatic(0.2F)), HasSubstr("a step is at most 0.05 m (limits of the fluid 'water')"));
  EXPECT_THAT(refusal(duty(0.6F)), HasSubstr("is outside -1 to 0.5 (limits of the fluid 'water')"));
  robot.fluid = "oil";
  EXPECT_EQ(refusal(duty(0.6F)), "");
  EXPECT_THAT(refusal(duty(0.9F)), HasSubstr("is outside -1 to 0.8 (limits of the fluid 'oil')"));
}

TEST_F(CommandChecksTest, ADutyBeyondTheLimitsOfAFluidThatWasNamedSinceIsNotRenewed) {
  robot.context.mode = rheonaut_MODE_MANUAL;
  robot.sample = station::Sample{.duty = 0.8F};
  robot.fluid = "oil";
  EXPECT_EQ(refusal(renewal()), "");
  robot.fluid = "water";
  EXPECT_THAT(refusal(renewal()), HasSubstr("out_of_range"));
  robot.context.mode = rheonaut_MODE_AUTO;
  EXPECT_EQ(refusal(renewal()), "") << "there its controller has the range";
}

TEST_F(CommandChecksTest, AScheduleBeyondTheLimitsOfAFluidThatWasNamedSinceIsNotRenewed) {
  robot.context.mode = rheonaut_MODE_MANUAL;
  robot.sample = station::Sample{.duty = 0.1F};
  auto running = schedule({{0, 0.8F}, {1000, 0.1F}, {2000, 0.6F}, {3000, 0}});
  ahead = {{&running, 1, 30'000'001, false, 10'000'000}};
  robot.fluid = "oil";
  EXPECT_EQ(refusal(renewal()), "");
  robot.fluid = "water";
  EXPECT_THAT(refusal(renewal()), HasSubstr("0.6"));
  ahead[0].sampled_us = 30'000'000;
  EXPECT_EQ(refusal(renewal()), "") << "what lies behind it does not count";
}

TEST_F(CommandChecksTest, WhereTheFluidIsNotKnownTheStrictestOfAllLimitsHold) {
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
  config::CommandLimits strict, loose;
  strict.duty_max = 0.2;
  strict.setpoint_max_m = 0.5;
  const config::Envelope envelope{strict, {{"oil", loose}}};
  EXPECT_EQ(envelope.strictest(), strict);
  EXPECT_EQ(envelope.in("oil"), loose);
  EXPECT_EQ(envelope.in("water"), strict) << "a built-in fluid without limits of its own";
}

TEST(Envelope, LimitsAreNarrowerInAnyOfTheirQuantities) {
  config::CommandLimits limits, others;
  EXPECT_FALSE(is_narrower_than(limits, others));
  limits.duty_max = 0.5;
  limits.power_s = 100;
  EXPECT_TRUE(is_narrower_than(limits, others));
  EXPECT_TRUE(is_narrower_than(others, limits));
  limits.duty_max = 1;
  EXPECT_FALSE(is_narrower_than(limits, others));
}

TEST(Envelope, AnUnknownFluidIsRefusedWithTheList) {
  const config::Envelope envelope{{}, {{"oil", {}}}};
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

TEST_F(CommandChecksTest, NoMotionPassesALatchAndNoClearAStopOnItsWay) {
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
