// The faults of the link by time line, in virtual time: what the robot makes of them, and how they end.
#include "tests/sim_robot/fault_effects.hpp"

#include <gmock/gmock.h>

namespace sim_robot {
namespace {

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

}  // namespace
}  // namespace sim_robot
