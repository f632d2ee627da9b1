// Which commands run: identity, time to live, arguments and mode.
#include <cmath>

#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;
using Commands = DrivenRobot;

TEST_F(Commands, AutoFollowsItsSetpointAndManualEndsIt) {
  EXPECT_EQ(answer(set_auto(0.1F)), "accepted");
  EXPECT_EQ(last().mode, rheonaut_MODE_AUTO);
  EXPECT_EQ(last().setpoint_m, 0.1F);
  EXPECT_EQ(last().reference_m, 0.1F);
  EXPECT_EQ(answer(set_setpoint(0.2F)), "accepted");
  EXPECT_EQ(last().setpoint_m, 0.2F);
  station.send(set_manual());
  expect_at_rest();
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_MODE_CHANGED), 2);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_SETPOINT_CHANGED), 2);
}

TEST_F(Commands, EnteringAutoStartsTheControllerAfresh) {
  order(set_auto(0.1F));
  const float first = last().duty;
  station.run(100);
  order(set_manual());
  station.run(2000);
  order(zero_position());
  order(set_auto(0.1F));
  EXPECT_EQ(last().duty, first);
}

TEST_F(Commands, RunOnceHoweverOftenTheyArrive) {
  protocol::Command command = set_duty(0.5F);
  command.command_id = 42;
  EXPECT_EQ(answer(command), "accepted");
  order(set_duty(0));
  EXPECT_EQ(answer(command), "duplicate");
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Commands, AreRememberedFor64Others) {
  protocol::Command command = set_duty(0);
  command.command_id = 42;
  order(command);
  for (int i = 0; i < 63; ++i) order(ping());
  EXPECT_EQ(answer(command), "duplicate");
}

TEST_F(Commands, ExpireWithoutEffect) {
  protocol::Command command = set_duty(0.5F);
  command.valid_until_robot_us = robot.robot_time_us() - 1;
  EXPECT_EQ(answer(command), "expired");
  EXPECT_EQ(core().duty(), 0);
}

// By the robot's clock, which also runs between ticks: the moment at which the bytes arrive counts.
TEST_F(Commands, LiveToTheMicrosecondByTheRobotsClock) {
  const std::uint64_t now_us = robot.robot_time_us();
  const auto answer_at = [this](std::uint64_t at_us, std::uint64_t valid_until_us) {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    frame.body.command = ping();
    frame.body.command.command_id = valid_until_us;
    frame.body.command.boot_id = kBootId;
    frame.body.command.valid_until_robot_us = valid_until_us;
    std::uint8_t bytes[protocol::kMaxFramedBytes];
    EXPECT_TRUE(robot.receive({bytes, protocol::write_frame(frame, bytes, sizeof bytes)}, at_us));
    station.listen();
    return result(station.ack_of(valid_until_us).value_or(protocol::CommandAck{}));
  };
  EXPECT_EQ(answer_at(now_us + 3'000, now_us + 3'000), "accepted");
  EXPECT_EQ(answer_at(now_us + 3'000, now_us + 2'999), "expired");
  EXPECT_EQ(answer_at(now_us + 3'000, now_us + 10'003'000), "accepted");
  EXPECT_EQ(answer_at(now_us + 3'000, now_us + 10'003'001), "life_too_long");
}

TEST_F(Commands, AreRefusedWithALifeOverTenSeconds) {
  protocol::Command command = set_duty(0.5F);
  command.valid_until_robot_us = robot.robot_time_us() + 10'000'001;
  EXPECT_EQ(answer(command), "life_too_long");
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Commands, ForAnotherBootDoNothing) {
  protocol::Command command = set_duty(0.5F);
  command.boot_id = kBootId + 1;
  EXPECT_EQ(answer(command), "other_boot");
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Commands, WithoutIdOrActionAreMalformed) {
  protocol::Command nothing = rheonaut_Command_init_zero;
  EXPECT_EQ(answer(nothing), "malformed");
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = set_duty(0.5F);
  frame.body.command.boot_id = kBootId;
  frame.body.command.valid_until_robot_us = robot.robot_time_us() + kTickUs;
  station.send(frame);
  station.step();
  EXPECT_EQ(result(station.acks.back()), "malformed");
  EXPECT_EQ(core().duty(), 0);
}

TEST_F(Commands, RefuseArgumentsThatAreNotFinite) {
  EXPECT_EQ(answer(set_duty(std::nanf(""))), "not_finite");
  EXPECT_EQ(answer(set_auto(std::nanf(""))), "not_finite");
  order(set_auto(0.1F));
  EXPECT_EQ(answer(set_setpoint(INFINITY)), "not_finite");
  EXPECT_EQ(answer(inject_disturbance(std::nanf(""))), "not_finite");
  EXPECT_EQ(last().setpoint_m, 0.1F);
}

TEST_F(Commands, RefuseArgumentsOutOfRange) {
  EXPECT_EQ(answer(set_duty(1.01F)), "out_of_range");
  EXPECT_EQ(answer(set_duty(-1.01F)), "out_of_range");
  EXPECT_EQ(answer(set_duty(0.5F, 501)), "out_of_range");
  EXPECT_EQ(answer(set_auto(1.01F)), "out_of_range");
  EXPECT_EQ(mode(), "manual");
  order(set_auto(0.1F));
  EXPECT_EQ(answer(set_setpoint(-1.01F)), "out_of_range");
  EXPECT_EQ(last().setpoint_m, 0.1F);
}

TEST_F(Commands, AreRefusedInTheWrongMode) {
  EXPECT_EQ(answer(set_setpoint(0.1F)), "wrong_mode");
  EXPECT_EQ(answer(inject_disturbance(0.1F)), "wrong_mode");
  order(set_auto(0.1F));
  EXPECT_EQ(answer(set_duty(0.1F)), "wrong_mode");
  EXPECT_EQ(answer(zero_position()), "wrong_mode");
  EXPECT_EQ(answer(renew_lease()), "nothing_to_renew");
}

TEST_F(Commands, SetModeWantsASetpointForAutoAndNoneForManual) {
  protocol::Command no_setpoint = set_auto(0.1F);
  no_setpoint.action.set_mode.has_setpoint_m = false;
  EXPECT_EQ(answer(no_setpoint), "malformed");
  protocol::Command with_setpoint = set_manual();
  with_setpoint.action.set_mode.has_setpoint_m = true;
  EXPECT_EQ(answer(with_setpoint), "malformed");
  protocol::Command emergency = set_manual();
  emergency.action.set_mode.mode = rheonaut_MODE_EMERGENCY;
  EXPECT_EQ(answer(emergency), "malformed");
}

TEST_F(Commands, ADisturbanceShiftsTheMeasurementAndEndsWithAuto) {
  order(set_auto(0));
  order(inject_disturbance(-0.05F));
  EXPECT_FLOAT_EQ(last().position_m, -0.05F);
  EXPECT_EQ(last().disturbance_m, -0.05F);
  EXPECT_GT(last().duty, 0);
  station.send(set_manual());
  expect_at_rest();
}

TEST_F(Commands, ZeroPositionOnlyAtRest) {
  order(set_duty(0.5F));
  station.run(40);
  EXPECT_EQ(answer(zero_position()), "motor_on");
  order(set_duty(0));
  station.run(100);
  ASSERT_GT(last().position_m, 1e-3F);
  EXPECT_EQ(answer(zero_position()), "accepted");
  EXPECT_NEAR(last().position_m, 0, 1e-4);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_POSITION_ZEROED), 1);
}

TEST_F(Commands, ATimedCommandActsAtItsTick) {
  protocol::Command command = set_auto(0.1F);
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = robot.robot_time_us() + 5 * kTickUs;
  const auto ack = order(command);
  EXPECT_EQ(result(ack), "accepted");
  EXPECT_EQ(ack.effect_at_robot_us, command.execute_at_robot_us);
  station.run(10);
  for (const auto& [seq, sample] : station.samples) {
    const bool due = sample.robot_time_us >= command.execute_at_robot_us;
    EXPECT_EQ(sample.mode, due ? rheonaut_MODE_AUTO : rheonaut_MODE_MANUAL);
  }
}

TEST_F(Commands, ATimedCommandWhoseTickComesAfterItsLifeExpires) {
  protocol::Command command = set_duty(0.5F);
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = robot.robot_time_us() + 5 * kTickUs;
  command.valid_until_robot_us = robot.robot_time_us() + 10 * kTickUs;
  const auto id = station.send(command);
  station.step();
  EXPECT_EQ(result(*station.ack_of(id)), "accepted");
  robot.skip(10);
  station.step();
  EXPECT_EQ(result(*station.ack_of(id)), "expired");
  expect_at_rest();
}

TEST_F(Commands, ATimedCommandRunsToTheEndOfItsTimeToLive) {
  protocol::Command command = set_duty(0.5F);
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = robot.robot_time_us() + 5 * kTickUs;
  command.valid_until_robot_us = robot.robot_time_us() + 10 * kTickUs;
  order(command);
  robot.skip(9);
  station.step();
  EXPECT_EQ(core().duty(), 0.5F);
}

TEST_F(Commands, OnlyAFewWaitAndNoneLongerThanItLives) {
  const auto timed = [this](std::uint64_t ticks) {
    protocol::Command command = ping();
    command.has_execute_at_robot_us = true;
    command.execute_at_robot_us = robot.robot_time_us() + ticks * kTickUs;
    return command;
  };
  for (std::uint64_t i = 0; i < 4; ++i) EXPECT_EQ(answer(timed(100)), "accepted");
  EXPECT_EQ(answer(timed(100)), "busy");
  protocol::Command beyond = timed(100);
  beyond.valid_until_robot_us = robot.robot_time_us() + 50 * kTickUs;
  EXPECT_EQ(answer(beyond), "out_of_range");
}

TEST_F(Commands, AChangeOfModeDropsTimedCommands) {
  protocol::Command later = set_duty(0.5F);
  later.has_execute_at_robot_us = true;
  later.execute_at_robot_us = robot.robot_time_us() + 5 * kTickUs;
  order(later);
  order(set_manual());
  expect_at_rest();
}

TEST(OneWayMotor, RefusesAReverseDuty) {
  SimulatedRobotConfig config;
  config.duty = {0, 1};
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.connect();
  const auto id = station.send(set_duty(-0.1F));
  station.run(2);
  EXPECT_EQ(station.ack_of(id)->reason, rheonaut_REJECT_REASON_OUT_OF_RANGE);
}

TEST_F(Commands, ThePositionIsNotZeroedInThePauseOfASchedule) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_duty_schedule_tag;
  auto& schedule = command.action.set_duty_schedule;
  schedule.tick_count = schedule.duty_count = 4;
  for (pb_size_t i = 0; i < 4; ++i) {
    schedule.tick[i] = i * 10;
    schedule.duty[i] = i % 2 == 0 ? 0.5F : 0;
  }
  order(command);
  station.run(13);
  ASSERT_EQ(core().duty(), 0);
  EXPECT_EQ(answer(zero_position()), "motor_on");
}

}  // namespace
}  // namespace robot_fw
