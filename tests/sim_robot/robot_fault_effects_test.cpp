// The faults of the robot itself by time line, in virtual time: resets, stalls, a wrong clock, a motor without supply.
#include <gmock/gmock.h>

#include "sim_robot/lab/lab.hpp"
#include "tests/sim_robot/fault_effects.hpp"

namespace sim_robot {
namespace {

TEST_F(FaultEffects, AWatchdogComesUpLatchedAndTheBootIsANewOne) {
  begin_in_auto({{2, reboot(rheonaut_RESET_CAUSE_WATCHDOG, 0.8)}});
  run_to(1.9);
  const auto boot_id = station->hello->boot_id;
  run_to(2.1);
  EXPECT_FALSE(life.is_on());
  EXPECT_EQ(core().duty(), 0);
  run_to(4);
  EXPECT_EQ(life.boots(), 2);
  EXPECT_NE(station->hello->boot_id, boot_id);
  EXPECT_EQ(station->hello->reset_cause, rheonaut_RESET_CAUSE_WATCHDOG);
  EXPECT_EQ(station->hello->emergency_cause, rheonaut_EMERGENCY_CAUSE_RESET);
  EXPECT_EQ(core().mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_TRUE(faults.in_force().empty());
  ASSERT_EQ(station->earlier_boots.size(), 1u);
  EXPECT_EQ(station->earlier_boots[0].rbegin()->first, 196u) << "of 199, what was in its last frame";
  expect_whole();
}

TEST_F(FaultEffects, AFlashThatIsErasedForgetsItsParameters) {
  Fault erased = reboot(rheonaut_RESET_CAUSE_EXTERNAL, 0.1);
  erased.keeps_storage = false;
  faults = FaultTimeline{{{2, reboot(rheonaut_RESET_CAUSE_EXTERNAL, 0.1)}, {4, erased}}};
  begin();
  station->send(set_parameter("setpoint_limit_m", 0.25F));
  std::vector<std::string> answers;
  for (const double time_s : {1.9, 3.9, 5.9}) {
    run_to(time_s);
    const auto beyond = station->send(set_auto(0.3F));
    run_to(time_s + 0.05);
    answers.push_back(answer(beyond));
    station->send(set_manual());
  }
  EXPECT_THAT(answers, ::testing::ElementsAre("out_of_range", "out_of_range", "accepted"));
}

TEST_F(FaultEffects, ABlockMissesTicksAndTheMotorGoesOffMeanwhile) {
  begin_in_auto({{2, fault_of(FaultKind::block, 0.3)}});
  const auto samples = [&] { return station->samples.size(); };
  run_to(2.05);
  const auto before = samples();
  run_to(2.28);
  EXPECT_EQ(samples(), before);
  EXPECT_NE(core().duty(), 0) << "nothing runs that could change it";
  EXPECT_EQ(life.robot().motor_duty(), 0) << "the board's own watch";
  run_to(4);
  EXPECT_NEAR(status().missed_ticks, 30, 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_TIME_STEP), 1);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  EXPECT_TRUE(faults.in_force().empty());
  expect_whole();
}

TEST_F(FaultEffects, ABlockForEverEndsWhenItIsWithdrawnOrTheRobotBoots) {
  begin_in_auto({});
  const auto id = inject(fault_of(FaultKind::block));
  run_to(now_s() + 0.5);
  EXPECT_TRUE(life.is_blocked());
  EXPECT_TRUE(faults.withdraw(id, faulty()));
  EXPECT_FALSE(life.is_blocked());
  run_to(now_s() + 0.1);
  EXPECT_TRUE(is_back());
  inject(fault_of(FaultKind::block));
  run_to(now_s() + 0.5);
  inject(reboot(rheonaut_RESET_CAUSE_WATCHDOG, 0.1));
  EXPECT_TRUE(faults.in_force().empty());
  run_to(now_s() + 0.2);
  EXPECT_FALSE(life.is_blocked());
  EXPECT_TRUE(is_back());
}

TEST_F(FaultEffects, AClockDriftsForItsTimeAndThenAsTheRobotsOwn) {
  SimulatedRobotConfig config;
  config.clock_drift_ppm = 100;
  Fault fast = fault_of(FaultKind::clock_drift, 10);
  fast.drift_ppm = 10'000;
  Lab lab{config, {}, {{10, fast}}};
  const auto ahead_us = [&lab] {
    return static_cast<double>(lab.robot.robot_clock_us()) - static_cast<double>(lab.robot.true_us());
  };
  const auto run_to = [&lab](double time_s) {
    while (lab.robot.true_us() < microseconds(time_s)) lab.step();
  };
  run_to(10);
  EXPECT_NEAR(ahead_us(), 1000, 2);
  run_to(20);
  EXPECT_NEAR(ahead_us(), 1000 + 100'000, 3);
  run_to(30);
  EXPECT_NEAR(ahead_us(), 1000 + 100'000 + 1000, 4);
  EXPECT_EQ(lab.link.connections(), 1);
  EXPECT_EQ(lab.station.lost_samples(), 0u);
  for (const auto& event : lab.station.events) EXPECT_NE(event.kind, rheonaut_EVENT_KIND_TIME_STEP);
}

TEST_F(FaultEffects, AClockThatIsOffStands) {
  Fault fast = fault_of(FaultKind::clock_drift);
  fast.drift_ppm = 100'000;
  faults = FaultTimeline{{{1, reboot(rheonaut_RESET_CAUSE_POWER_ON, 2)}, {2, fast}}};
  begin();
  run_to(3.5);
  EXPECT_NEAR(static_cast<double>(life.robot_clock_us()), 0.5 * 1.1e6, 2000);
  EXPECT_EQ(core().mode(), rheonaut_MODE_MANUAL);
}

TEST_F(FaultEffects, AClockThatJumpsForwardEndsWhatHasRunOut) {
  Fault forward = fault_of(FaultKind::clock_jump);
  forward.jump_s = 5;
  begin_in_auto({{2, forward}});
  run_to(2.05);
  expect_still();
  EXPECT_TRUE(is_back(2));
  EXPECT_TRUE(faults.in_force().empty());
  expect_whole();
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_TIME_STEP), 1);
}

TEST_F(FaultEffects, AClockThatJumpsBackLatches) {
  Fault back = fault_of(FaultKind::clock_jump);
  back.jump_s = -0.5;
  begin_in_auto({{2, back}});
  run_to(2.1);
  EXPECT_EQ(core().mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(core().emergency_cause(), rheonaut_EMERGENCY_CAUSE_INTERNAL_ERROR);
}

TEST_F(FaultEffects, AMotorSupplyThatIsCutStopsTheRobotAndItStaysStoppedAfterwards) {
  Fault cut = fault_of(FaultKind::motor_supply_cut);
  cut.for_s = 1;
  begin_in_auto({{2, cut}});
  run_to(2.05);
  EXPECT_EQ(core().emergency_cause(), rheonaut_EMERGENCY_CAUSE_MOTOR_SUPPLY_CUT);
  run_to(6);
  EXPECT_EQ(core().mode(), rheonaut_MODE_EMERGENCY) << "the supply has been back for 3 s";
  EXPECT_EQ(core().duty(), 0);
}

}  // namespace
}  // namespace sim_robot
