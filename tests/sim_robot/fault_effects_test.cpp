// The faults of link and robot by time line, in virtual time: what the robot makes of them, and how they end.
// LONG: one test for each fault, written in the words of one fixture.
#include <gmock/gmock.h>

#include "sim_robot/lab/lab.hpp"
#include "tests/sim_robot/link_story.hpp"

namespace sim_robot {
namespace {

Fault fault_of(FaultKind kind, double for_s = kForEver) {
  Fault fault;
  fault.kind = kind;
  fault.for_s = for_s;
  return fault;
}

Fault outage(double for_s, bool then_reset = false) {
  Fault fault = fault_of(FaultKind::link_outage, for_s);
  fault.then_reset = then_reset;
  return fault;
}

Fault half_open(Direction direction, double for_s = kForEver) {
  Fault fault = fault_of(FaultKind::link_half_open, for_s);
  fault.direction = direction;
  return fault;
}

Fault delay(double delay_s, Direction direction, double for_s = kForEver) {
  Fault fault = fault_of(FaultKind::link_delay, for_s);
  fault.delay_s = delay_s;
  fault.direction = direction;
  return fault;
}

Fault throttle(double bytes_per_s, double for_s = kForEver) {
  Fault fault = fault_of(FaultKind::link_throttle, for_s);
  fault.bytes_per_s = bytes_per_s;
  return fault;
}

Fault reboot(protocol::ResetCause cause, double off_for_s) {
  Fault fault = fault_of(FaultKind::reboot);
  fault.cause = cause;
  fault.off_for_s = off_for_s;
  return fault;
}

// In auto, on its way, from 1 s on; the faults come later.
class FaultEffects : public LinkStory {
 protected:
  void begin_in_auto(std::vector<TimedFault> timed, const LinkOptions& options = {}) {
    faults = FaultTimeline{std::move(timed)};
    begin(options);
    run_to(1);
    ASSERT_TRUE(reached_auto(0.5F));
  }
  std::uint64_t inject(const Fault& fault) { return faults.inject(fault, faulty()); }
  // On so many connections since the beginning, or more.
  bool is_back(int connections = 1) {
    return run_until([&] { return link->connections() >= connections && caught_up(); }, 10);
  }
  double age_of_newest_s() const {
    return now_s() - 1e-6 * static_cast<double>(station->samples.rbegin()->second.robot_time_us);
  }
};

// Outage.

TEST_F(FaultEffects, AnOutageStopsTheMotorAfterTheTimeOutAndLosesNoSample) {
  begin_in_auto({{3, outage(3)}});
  run_to(3.7);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  run_to(4.1);
  EXPECT_TRUE(core().link_lost());
  expect_still();
  run_to(5.9);
  EXPECT_EQ(faults.in_force().size(), 1u);
  EXPECT_FALSE(station->link_is_up());
  run_to(6.1);
  EXPECT_TRUE(faults.in_force().empty());
  EXPECT_TRUE(is_back(2));
  expect_whole();
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_RESTORED), 1);
}

TEST_F(FaultEffects, AnOutageEndsInAResetWhenItSaysSo) {
  begin_in_auto({{2, outage(0.4, true)}});
  run_to(2.39);
  EXPECT_TRUE(link->robot_is_connected());
  run_to(2.42);
  EXPECT_FALSE(link->robot_is_connected());
  EXPECT_TRUE(is_back(2));
  expect_whole();
}

TEST_F(FaultEffects, AWithdrawnOutageIsOverAtOnce) {
  begin_in_auto({});
  const auto id = inject(outage(kForEver));
  run_to(now_s() + 0.6);
  EXPECT_GT(station->silence_us(), 550'000u);
  EXPECT_TRUE(faults.withdraw(id, faulty()));
  step();
  EXPECT_LE(station->silence_us(), 10'000u);
  EXPECT_EQ(link->connections(), 1);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  expect_whole();
}

TEST_F(FaultEffects, AWithdrawnOutageResetsWhenItSaysSo) {
  begin_in_auto({});
  const auto id = inject(outage(kForEver, true));
  run_to(now_s() + 0.3);
  faults.withdraw(id, faulty());
  EXPECT_FALSE(link->robot_is_connected());
  EXPECT_TRUE(is_back(2));
  expect_whole();
}

TEST_F(FaultEffects, AnOutageReplacesTheOneBeforeWithNothingInBetween) {
  begin_in_auto({{2, outage(60, true)}, {2.2, outage(0.3)}});
  run_to(2.4);
  EXPECT_EQ(faults.in_force().size(), 1u);
  EXPECT_GT(station->silence_us(), 380'000u);
  run_to(3);
  EXPECT_LT(station->silence_us(), 100'000u);
  EXPECT_EQ(link->connections(), 1);
  expect_whole();
}

// Half-open.

TEST_F(FaultEffects, HalfOpenIsSilenceUntilTheRobotDialsAgain) {
  for (const Direction direction : {Direction::up, Direction::down, Direction::both}) {
    begin_in_auto({});
    const int connections = link->connections();
    inject(half_open(direction));
    ASSERT_TRUE(run_until([&] { return link->connections() > connections; }, 5));
    EXPECT_TRUE(is_back());
    EXPECT_EQ(faults.in_force().size(), 1u) << "which takes the connections that were there alone";
    expect_whole();
    station->send(set_manual());
    run_to(now_s() + 0.1);
    life.reboot({});
    life.advance_to(life.true_us() + 1'000'000);
  }
}

TEST_F(FaultEffects, AShortHalfOpenPassesAndTheConnectionGoesOn) {
  begin_in_auto({{2, half_open(Direction::both, 0.5)}});
  run_to(2.49);
  EXPECT_GT(station->silence_us(), 470'000u);
  run_to(2.52);
  EXPECT_LE(station->silence_us(), 20'000u);
  EXPECT_EQ(link->connections(), 1);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  expect_whole();
}

TEST_F(FaultEffects, AHalfOpenThatReplacesAnOutageLeavesTheOtherDirection) {
  begin_in_auto({{2, outage(60)}, {2.2, half_open(Direction::up, 0.5)}});
  run_to(2.6);
  EXPECT_GT(station->silence_us(), 300'000u);
  run_to(3.4);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO) << "it has heard the station";
  EXPECT_EQ(link->connections(), 1);
  expect_whole();
}

// Cut and reset.

TEST_F(FaultEffects, ACutAndAResetAreDialledAgainAndAutoGoesOn) {
  Fault cut = fault_of(FaultKind::link_cut);
  cut.after_bytes = 3;
  begin_in_auto({{2, cut}, {4, fault_of(FaultKind::link_reset)}});
  run_to(2.02);
  EXPECT_FALSE(link->robot_is_connected());
  run_to(3.5);
  EXPECT_EQ(link->connections(), 2);
  run_to(4.01);
  EXPECT_FALSE(link->robot_is_connected());
  run_to(5.5);
  EXPECT_EQ(link->connections(), 3);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 0);
  EXPECT_TRUE(faults.in_force().empty());
  expect_whole();
}

// Delay, throttle, loss, split: settings of the same link, each with an end of its own.

LinkOptions slow_link() {
  LinkOptions options;
  options.up.delay_s = options.down.delay_s = 0.02;
  options.up.split_bytes = 700;
  return options;
}

TEST_F(FaultEffects, EachSettingEndsByItselfAndTheRestStays) {
  Fault loss = fault_of(FaultKind::link_loss, 2);
  loss.loss_probability = 0.1;
  loss.retransmit_s = 0.3;
  Fault split = fault_of(FaultKind::link_split, 4);
  split.split_bytes = 7;
  begin_in_auto({{2, delay(0.1, Direction::up, 1)}, {2.5, throttle(20'000, 3)}, {3.5, loss}, {4, split}}, slow_link());
  run_to(2.1);
  EXPECT_EQ(link->impairments().up.delay_s, 0.1);
  EXPECT_EQ(link->impairments().down.delay_s, 0.02);
  run_to(3.2);
  EXPECT_EQ(link->impairments().up.delay_s, 0.02) << "over";
  EXPECT_EQ(link->impairments().down.bytes_per_s, 20'000);
  run_to(4.1);
  EXPECT_EQ(link->impairments().up.retransmit_s, 0.3);
  EXPECT_EQ(link->impairments().up.split_bytes, 7u);
  EXPECT_EQ(faults.in_force().size(), 3u);
  run_to(6);
  EXPECT_EQ(link->impairments().up.bytes_per_s, 0);
  EXPECT_EQ(link->impairments().up.loss_probability, 0);
  EXPECT_EQ(link->impairments().up.retransmit_s, 0.2);
  EXPECT_EQ(link->impairments().down.split_bytes, 7u);
  run_to(9);
  EXPECT_EQ(link->impairments().up.split_bytes, 700u);
  EXPECT_EQ(link->impairments().down.split_bytes, 0u);
  EXPECT_EQ(link->connections(), 1);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  expect_whole();
}

TEST_F(FaultEffects, ADelayIsSeenByTheStationUntilItIsWithdrawn) {
  begin_in_auto({});
  const auto id = inject(delay(0.4, Direction::up));
  run_to(now_s() + 2);
  EXPECT_GE(age_of_newest_s(), 0.399);
  EXPECT_TRUE(faults.withdraw(id, faulty()));
  run_to(now_s() + 2);
  EXPECT_LT(age_of_newest_s(), 0.1);
}

TEST_F(FaultEffects, ASettingReplacesTheOneBeforeInBothDirections) {
  begin_in_auto({});
  inject(delay(0.2, Direction::up));
  inject(delay(0.3, Direction::down));
  EXPECT_EQ(link->impairments().up.delay_s, 0);
  EXPECT_EQ(link->impairments().down.delay_s, 0.3);
  EXPECT_EQ(faults.in_force().size(), 1u);
}

TEST_F(FaultEffects, AThrottleSlowsTheBackfillAndNothingIsLost) {
  begin_in_auto({{2, outage(4)}, {2, throttle(5500)}});
  run_to(6);
  ASSERT_TRUE(run_until([&] { return station->link_is_up() && !station->samples.empty(); }, 8));
  run_to(now_s() + 2);
  EXPECT_FALSE(caught_up()) << "the throttle outlives the outage";
  ASSERT_TRUE(run_until([&] { return caught_up(); }, 60));
  expect_whole();
}

TEST_F(FaultEffects, RefusesWhatTheLinkRefusesBeforeAnythingEnds) {
  begin_in_auto({});
  inject(outage(kForEver));
  Fault broken = outage(1);
  broken.for_s = 0;
  EXPECT_THROW(inject(broken), std::invalid_argument);
  EXPECT_EQ(faults.in_force().size(), 1u);
}

// Reboot, block, clock.

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
