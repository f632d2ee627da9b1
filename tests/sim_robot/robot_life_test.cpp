// Reboots, brown-outs and clocks that lie: what outlives them, and what the station sees.
#include <gtest/gtest.h>

#include "tests/sim_robot/story.hpp"

namespace sim_robot {
namespace {

class RobotFaults : public ::testing::Test, protected Story {
 protected:
  void be_under_way() {
    go_to(0.5);
    await(in_truth(motor_on()));
  }
  void await_boot(int number, Limit limit = {5}) { await(connections().is(number) and link_up(), limit); }
  void expect_still() { expect(in_truth(motor_off() and not in_auto())); }
  const protocol::Hello& hello() { return *station().hello; }

  float setpoint_limit_m() {
    station().pages.clear();
    send(get_parameters(0)).expect_accepted();
    pass(0.2);
    for (const auto& page : station().pages) {
      for (pb_size_t i = 0; i < page.parameters_count; ++i) {
        if (std::string(page.parameters[i].name) == "setpoint_limit_m") return page.parameters[i].value;
      }
    }
    return 0;
  }
};

TEST_F(RobotFaults, ARebootIsANewBootInManualWithTheMotorOff) {
  begin();
  be_under_way();
  pass(1);
  const auto boot_id = hello().boot_id;
  const double moved_m = moment().truth.position_m;
  reboot();
  expect(in_truth(motor_off()));
  await_boot(2);
  EXPECT_NE(hello().boot_id, boot_id);
  EXPECT_EQ(hello().reset_cause, rheonaut_RESET_CAUSE_SOFTWARE);
  EXPECT_EQ(hello().mode, rheonaut_MODE_MANUAL);
  pass(1);
  EXPECT_EQ(station().earlier_boots.size(), 1u);
  EXPECT_EQ(station().samples.begin()->first, 0u);
  expect(in_truth(position().above(moved_m)));  // it coasts through the reboot
  expect_whole();
  expect_still();
}

TEST_F(RobotFaults, ARobotThatLosesPowerLeavesItsConnectionHalfOpen) {
  begin();
  reboot({.cause = rheonaut_RESET_CAUSE_POWER_ON, .off_for_s = 20, .keeps_latch = false});
  await(link_lost(), {.limit_s = 2});
  EXPECT_FALSE(station().is_connected());
  expect(connections().is(1));
  await(link_up(), {.limit_s = 25});
  EXPECT_GT(moment().time_s, 20);
}

TEST_F(RobotFaults, TheLatchOutlivesAResetWhereItsMemoryDoes) {
  begin();
  const auto emergency_id = stop().emergency_id;
  ASSERT_NE(emergency_id, 0u);
  reboot({.cause = rheonaut_RESET_CAUSE_EXTERNAL});
  await_boot(2);
  EXPECT_EQ(hello().emergency_id, emergency_id);
  EXPECT_EQ(hello().emergency_cause, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  reboot({.cause = rheonaut_RESET_CAUSE_POWER_ON, .off_for_s = 1, .keeps_latch = false});
  await_boot(3);
  EXPECT_EQ(hello().emergency_id, 0u);
}

TEST_F(RobotFaults, BrownOutAndWatchdogComeUpLatched) {
  begin();
  int boots = 1;
  for (const auto cause : {rheonaut_RESET_CAUSE_BROWN_OUT, rheonaut_RESET_CAUSE_WATCHDOG}) {
    be_under_way();
    reboot({.cause = cause, .off_for_s = 0.8, .keeps_latch = false});
    await_boot(++boots);
    EXPECT_EQ(hello().reset_cause, cause);
    EXPECT_EQ(hello().mode, rheonaut_MODE_EMERGENCY);
    EXPECT_EQ(hello().emergency_cause, rheonaut_EMERGENCY_CAUSE_RESET);
    send(set_auto(0.1F)).expect_refused("latched");
    clear();
  }
}

TEST_F(RobotFaults, ParametersOutliveARebootAsLongAsTheFlashDoes) {
  begin();
  send(set_parameter("setpoint_limit_m", 0.25F)).expect_accepted();
  pass(0.2);
  reboot();
  await_boot(2);
  EXPECT_EQ(setpoint_limit_m(), 0.25F);
  reboot({.keeps_storage = false});
  await_boot(3);
  EXPECT_EQ(setpoint_limit_m(), 1.0F);
}

TEST_F(RobotFaults, CommandsForTheBootBeforeAreRefused) {
  begin();
  protocol::Command command = set_auto(0.1F);
  command.boot_id = hello().boot_id;
  reboot();
  await_boot(2);
  send(command).expect_refused("other_boot");
  expect_still();
}

TEST_F(RobotFaults, ADriftingClockMakesItsTicksFasterOrSlowerAndLosesNothing) {
  for (const double ppm : {200.0, -200.0}) {
    begin();
    const double drifts_from_us = static_cast<double>(robot().true_us());
    suffer({.kind = FaultKind::clock_drift, .drift_ppm = ppm});
    pass(100);
    const double robot_us = drifts_from_us + 1e8 * (1 + 1e-6 * ppm);
    EXPECT_NEAR(static_cast<double>(robot().robot_clock_us()), robot_us, 1);
    EXPECT_NEAR(static_cast<double>(station().samples.rbegin()->second.robot_time_us), robot_us, 60'000);
    expect(connections().is(1));
    EXPECT_EQ(station().lost_samples(), 0u);
    expect_no_event("time_step");
  }
}

TEST_F(RobotFaults, AClockThatJumpsForwardIsATimeStepAndEndsWhatHasRunOut) {
  begin();
  be_under_way();
  suffer({.kind = FaultKind::clock_jump, .jump_s = 5});
  pass(0.01);
  expect(in_truth(motor_off() and in_manual()));  // by its clock the station was silent for 5 s
  await_boot(2, {.limit_s = 3});
  expect_event("time_step");
  expect_no_event("time_step");
  expect(in_truth(not link_lost()));
  expect_whole();
}

TEST_F(RobotFaults, AClockThatJumpsBackStopsTheRobotOnce) {
  begin();
  be_under_way();
  pass(1);
  suffer({.kind = FaultKind::clock_jump, .jump_s = -0.5});
  pass(0.1);
  expect(in_truth(motor_off() and in_emergency()));
  EXPECT_EQ(robot().core().emergency_cause(), rheonaut_EMERGENCY_CAUSE_INTERNAL_ERROR);
  expect_event("emergency");
  send(clear_emergency(robot().core().emergency_id())).expect_refused("cause_stands", {.limit_s = 0.1});
  pass(2);  // its time stood still until the clock had caught up
  expect_no_event("emergency");
  expect_no_event("time_step");
  clear();
  expect(in_truth(in_manual()));
  send(set_duty(0.3F)).expect_accepted();
  await(in_truth(motor_on()));
  await(in_truth(motor_off()), {.limit_s = 0.6});  // and leases run out again
  expect_whole();
}

TEST(RobotLife, TheWorldGoesOnInABlockAlsoWhenAResetEndsIt) {
  RobotLife life{{}};
  const auto run_to = [&life](double time_s) {
    for (std::uint64_t us = life.true_us(); us <= static_cast<std::uint64_t>(time_s * 1e6); us += 10'000) {
      life.advance_to(us);
    }
  };
  const auto world_s = [&life] { return life.robot().world().glucose().time_s(); };
  run_to(2);
  life.block(60);
  run_to(5);
  EXPECT_NEAR(world_s(), 5, 0.03);
  life.reboot({});
  run_to(6);
  EXPECT_NEAR(world_s(), 6, 0.05);
  EXPECT_GT(life.core().samples().next_seq(), 40u);
}

TEST(RobotLife, TheBooksOfABootAreClosedWhenItEnds) {
  RobotLife life{{}};
  life.advance_to(1'000'000);
  const std::uint64_t made = life.core().samples().next_seq();
  life.reboot({});
  EXPECT_EQ(life.lost_at_reboot(), made);
  life.advance_to(2'000'000);
  const std::uint64_t made_then = life.core().samples().next_seq();
  EXPECT_GT(made_then, 0u);
  life.reboot({});
  EXPECT_EQ(life.earlier_boots().samples_made, made + made_then);
  EXPECT_EQ(life.earlier_boots().samples_lost, made + made_then) << "nobody acknowledged one";
}

}  // namespace
}  // namespace sim_robot
