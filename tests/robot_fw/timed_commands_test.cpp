// Timed commands keep their order and their content in the room there is for them.
#include "tests/robot_fw/bare_core.hpp"
#include "tests/robot_fw/controllers.hpp"
#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

protocol::Command timed(protocol::Command command, std::uint64_t id, std::uint64_t execute_at_us) {
  command.command_id = id;
  command.boot_id = kBootId;
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = execute_at_us;
  command.valid_until_robot_us = execute_at_us + 1'000'000;
  return command;
}

// 64 entries of which each takes as much room as ticks of this size need; the last one ends it.
protocol::Command whole_schedule(std::uint32_t first_tick) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_duty_schedule_tag;
  rheonaut_SetDutySchedule& schedule = command.action.set_duty_schedule;
  schedule.tick_count = schedule.duty_count = kMaxScheduleEntries;
  for (std::uint32_t i = 0; i < kMaxScheduleEntries; ++i) {
    schedule.tick[i] = first_tick + i;
    schedule.duty[i] = i + 1 < kMaxScheduleEntries ? 0.01F * static_cast<float>(i + 1) : 0;
  }
  return command;
}

std::uint64_t taken_id(TimedCommands& commands, std::uint64_t now_us) {
  const auto command = commands.take_due(now_us);
  return command ? command->command_id : 0;
}

TEST(TimedCommands, RunInTheOrderOfTheirTimesAndThenOfTheirArrival) {
  TimedCommands commands;
  for (const auto& [id, at_us] : {std::pair{1U, 300U}, {2U, 100U}, {3U, 200U}, {4U, 100U}}) {
    EXPECT_TRUE(commands.hold(timed(sim_robot::set_duty(0.5F), id, at_us), 0));
  }
  EXPECT_EQ(taken_id(commands, 99), 0u);
  EXPECT_EQ(taken_id(commands, 250), 2u);
  EXPECT_TRUE(commands.hold(timed(sim_robot::ping(), 5, 100), 0));
  EXPECT_EQ(taken_id(commands, 250), 4u);
  EXPECT_EQ(taken_id(commands, 250), 5u);
  EXPECT_EQ(taken_id(commands, 250), 3u);
  EXPECT_EQ(taken_id(commands, 250), 0u);
  EXPECT_EQ(taken_id(commands, 300), 1u);
}

TEST(TimedCommands, AWholeScheduleOfALongLifeComesBackAsItWas) {
  TimedCommands commands;
  const std::uint64_t years_us = 250'000'000'000'000;
  const protocol::Command given = timed(whole_schedule(2'000'000), 0xFEDC'BA98'7654'3210, years_us);
  ASSERT_TRUE(commands.hold(given, 0));
  const auto taken = commands.take_due(years_us);
  ASSERT_TRUE(taken.has_value());
  EXPECT_EQ(taken->command_id, given.command_id);
  EXPECT_EQ(taken->valid_until_robot_us, given.valid_until_robot_us);
  const auto& schedule = taken->action.set_duty_schedule;
  ASSERT_EQ(schedule.tick_count, kMaxScheduleEntries);
  for (std::size_t i = 0; i < kMaxScheduleEntries; ++i) {
    EXPECT_EQ(schedule.tick[i], given.action.set_duty_schedule.tick[i]);
    EXPECT_EQ(schedule.duty[i], given.action.set_duty_schedule.duty[i]);
  }
}

TEST(TimedCommands, WithoutRoomAreNotHeldAndHarmNoOther) {
  TimedCommands commands;
  EXPECT_TRUE(commands.hold(timed(sim_robot::set_controller(biquad_controller()), 1, 200), 0));
  EXPECT_FALSE(commands.hold(timed(whole_schedule(2'000'000), 2, 100), 0));
  EXPECT_TRUE(commands.hold(timed(sim_robot::set_duty(-0.25F), 3, 300), 0));
  const auto controller = commands.take_due(1000);
  ASSERT_TRUE(controller.has_value());
  EXPECT_EQ(checksum_of(controller->action.set_controller), biquad_controller().checksum);
  const auto duty = commands.take_due(1000);
  ASSERT_TRUE(duty.has_value());
  EXPECT_EQ(duty->action.set_duty.duty, -0.25F);
  EXPECT_TRUE(commands.hold(timed(whole_schedule(2'000'000), 4, 100), 0));  // the room is free again
}

TEST(TimedCommands, WaitUnderALeaseThatEachNewOneAndEachRenewalBegins) {
  TimedCommands commands;
  EXPECT_FALSE(commands.renew_lease(0, 0)) << "nothing waits";
  commands.hold(timed(sim_robot::ping(), 1, 9'000'000), 0);
  EXPECT_FALSE(commands.lease_lapsed(499'999));
  EXPECT_TRUE(commands.lease_lapsed(500'000));
  commands.hold(timed(sim_robot::ping(), 2, 9'000'000), 400'000);
  EXPECT_FALSE(commands.lease_lapsed(899'999));
  EXPECT_TRUE(commands.renew_lease(100, 899'999));
  EXPECT_FALSE(commands.lease_lapsed(999'998));
  EXPECT_TRUE(commands.lease_lapsed(999'999));
  EXPECT_FALSE(commands.renew_lease(0, 999'999)) << "what has lapsed stays lapsed";
}

TEST(TimedCommands, AreAllDroppedByTheirIds) {
  TimedCommands commands;
  commands.hold(timed(sim_robot::ping(), 7, 200), 0);
  commands.hold(timed(sim_robot::ping(), 8, 100), 0);
  EXPECT_EQ(commands.drop_any().value_or(0) + commands.drop_any().value_or(0), 15u);
  EXPECT_FALSE(commands.drop_any().has_value());
}

using HeldSchedule = DrivenRobot;

TEST_F(HeldSchedule, Of64EntriesRunsTickByTick) {
  const std::uint64_t at_us = robot.robot_time_us() + 5 * kTickUs;
  EXPECT_EQ(answer(timed(whole_schedule(0), 42, at_us)), "accepted");
  station.run(30);
  EXPECT_EQ(answer(sim_robot::renew_lease()), "accepted");
  station.run(50);
  std::size_t seen = 0;
  for (const auto& [seq, sample] : station.samples) {
    if (sample.robot_time_us < at_us) continue;
    const std::size_t i = seen++;
    EXPECT_EQ(sample.duty, i + 1 < kMaxScheduleEntries ? 0.01F * static_cast<float>(i + 1) : 0) << i;
  }
  EXPECT_GT(seen, kMaxScheduleEntries);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DUTY_SCHEDULE_ENDED), 1);
}

TEST_F(HeldSchedule, MakesASecondOneBusyAndStillRuns) {
  const std::uint64_t at_us = robot.robot_time_us() + 5 * kTickUs;
  EXPECT_EQ(answer(timed(whole_schedule(0), 42, at_us)), "accepted");
  EXPECT_EQ(answer(timed(whole_schedule(0), 43, at_us)), "busy");
  station.run(10);
  EXPECT_GT(core().duty(), 0);
}

// Timed commands of a robot, each due so many ticks after it was sent; answers are the latest of the command.
class Waiting : public DrivenRobot {
 protected:
  std::uint64_t wait_for(const protocol::Command& command, std::uint64_t ticks) {
    const std::uint64_t id = station.send(sim_robot::timed(command, robot.robot_time_us() + ticks * kTickUs));
    station.step();
    EXPECT_EQ(result(*station.ack_of(id)), "accepted");
    return id;
  }
  std::string end_of(std::uint64_t id) const { return result(*station.ack_of(id)); }
  void renew_for(int ticks) {
    for (int i = 0; i < ticks; ++i) {
      if (i % 30 == 0) station.send(sim_robot::renew_lease());
      station.step();
    }
  }
};

TEST_F(Waiting, ExpiresWithItsLeaseAndMovesNothing) {
  const auto id = wait_for(sim_robot::set_duty(0.5F), 80);
  const auto schedule = wait_for(whole_schedule(0), 90);
  station.run(48);
  EXPECT_EQ(end_of(id), "accepted");
  station.run(3);
  EXPECT_EQ(end_of(id), "expired");
  EXPECT_EQ(end_of(schedule), "expired");
  EXPECT_EQ(answer(sim_robot::renew_lease()), "nothing_to_renew");
  station.run(100);
  expect_at_rest();
}

TEST_F(Waiting, LivesOnWhileItIsRenewed) {
  const auto id = wait_for(sim_robot::set_duty(0.5F), 200);
  renew_for(199);
  EXPECT_EQ(core().duty(), 0);
  renew_for(5);
  EXPECT_EQ(end_of(id), "accepted");
  EXPECT_EQ(core().duty(), 0.5F);
}

// SAFETY: renewals that were sent ahead would keep a motor on for as long as they reach.
TEST_F(Waiting, IsNotRenewedByARenewalThatWaitsItself) {
  order(sim_robot::set_duty(0.2F));
  EXPECT_EQ(answer(sim_robot::timed(sim_robot::renew_lease(), robot.robot_time_us() + 49 * kTickUs)), "malformed");
  station.run(60);
  expect_at_rest();
}

TEST_F(Waiting, IsRenewedInAutoToo) {
  order(sim_robot::set_auto(0.01F));
  EXPECT_EQ(answer(sim_robot::renew_lease()), "nothing_to_renew");
  wait_for(sim_robot::set_setpoint(0.02F), 100);
  renew_for(110);
  EXPECT_EQ(last().setpoint_m, 0.02F);
  const auto dropped = wait_for(sim_robot::set_setpoint(0.03F), 100);
  station.run(110);
  EXPECT_EQ(end_of(dropped), "expired");
  EXPECT_EQ(last().setpoint_m, 0.02F);
  EXPECT_EQ(mode(), "auto");
}

TEST_F(Waiting, EndsWithTheLeaseOfARunningDuty) {
  order(sim_robot::set_duty(0.2F, 100));
  const auto id = wait_for(sim_robot::set_duty(0.5F), 30);
  station.run(12);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LEASE_LAPSED), 1);
  EXPECT_EQ(end_of(id), "expired");
  station.run(30);
  expect_at_rest();
}

TEST_F(Waiting, IsAbortedByADutyOfZeroButNotByATimedOne) {
  const auto first = wait_for(sim_robot::set_duty(0), 10), second = wait_for(sim_robot::set_duty(0.5F), 15);
  station.run(20);
  EXPECT_EQ(end_of(first), "accepted");
  EXPECT_EQ(core().duty(), 0.5F);
  const auto third = wait_for(sim_robot::set_duty(0.4F), 15);
  EXPECT_EQ(answer(sim_robot::set_duty(0)), "accepted");
  EXPECT_EQ(end_of(second), "accepted");
  EXPECT_EQ(end_of(third), "expired");
  station.run(20);
  expect_at_rest();
}

TEST_F(Waiting, IsDroppedByDropTimedWhichEndsNothingElse) {
  order(sim_robot::set_duty(0.2F));
  const auto id = wait_for(sim_robot::set_duty(0.5F), 15), other = wait_for(whole_schedule(0), 20);
  EXPECT_EQ(answer(sim_robot::drop_timed()), "accepted");
  EXPECT_EQ(end_of(id), "expired");
  EXPECT_EQ(end_of(other), "expired");
  station.run(30);
  EXPECT_EQ(core().duty(), 0.2F);
  EXPECT_EQ(answer(sim_robot::drop_timed()), "accepted") << "also when nothing waits";
}

TEST_F(Waiting, IsDroppedWhenTheLinkIsLostBeforeItsLease) {
  station.welcome.link_timeout_ms = 200;
  station.disconnect();
  station.connect();
  station.run(2);
  const auto id = wait_for(sim_robot::set_auto(0.1F), 30);
  station.attentive = false;
  station.run(25);
  EXPECT_TRUE(core().link_lost());
  station.attentive = true;
  station.run(40);
  EXPECT_EQ(end_of(id), "expired");
  expect_at_rest();
}

// A schedule in mid-run, ended by each thing that ends it; nothing of it comes afterwards.
TEST_F(Waiting, ARunningScheduleEndsWithStopAbortModeAndLink) {
  const auto begin = [this] {
    EXPECT_EQ(answer(whole_schedule(0)), "accepted");
    station.run(20);
    EXPECT_GT(core().duty(), 0);
  };
  begin();
  order(sim_robot::emergency_stop());
  EXPECT_EQ(core().duty(), 0);
  order(sim_robot::clear_emergency(core().emergency_id()));
  expect_at_rest();
  for (const auto& command : {sim_robot::set_duty(0), sim_robot::set_manual()}) {
    begin();
    EXPECT_EQ(answer(command), "accepted");
    EXPECT_EQ(core().duty(), 0);
    expect_at_rest();
  }
  station.welcome.link_timeout_ms = 200;
  station.disconnect();
  station.connect();
  station.run(2);
  begin();
  station.attentive = false;
  station.run(25);
  EXPECT_TRUE(core().link_lost());
  EXPECT_EQ(core().duty(), 0);
  station.attentive = true;
  expect_at_rest();
}

TEST(WaitingBetweenTicks, WhatLapsedIsNotRevivedByANewOneThatComesBeforeTheTick) {
  BareCore core;
  core.renews = false;
  core.run(2);
  const auto wait_for = [&core](float duty, std::uint64_t id, std::uint64_t after_us) {
    protocol::Command command = timed(sim_robot::set_duty(duty), id, core.now_us + after_us);
    core.order(command);
    return std::ranges::count(core.acks, rheonaut_COMMAND_RESULT_EXPIRED, &protocol::CommandAck::result);
  };
  constexpr std::uint64_t kAfterTickUs = 5'000, kLeaseUs = protocol::kLeaseMs * 1'000;
  core.now_us += kAfterTickUs;
  EXPECT_EQ(wait_for(0.5F, 1, kLeaseUs + 100'000), 0);
  core.now_us -= kAfterTickUs;
  core.run(protocol::kLeaseMs / 10);  // the last tick that is within the lease
  core.now_us += kAfterTickUs + 1'000;
  EXPECT_EQ(wait_for(0.2F, 2, 200'000), 1) << "the first, not the second";
  core.now_us -= kAfterTickUs + 1'000;
  core.run(15);
  EXPECT_EQ(core.robot.duty(), 0) << "the first is due";
  core.run(8);
  EXPECT_EQ(core.robot.duty(), 0.2F);
}

}  // namespace
}  // namespace robot_fw
