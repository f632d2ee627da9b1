// What each fault of the network makes of the robot and of the least of a station, as docs/network_faults.md says.
#include <gtest/gtest.h>

#include "tests/sim_robot/story.hpp"

namespace sim_robot {
namespace {

class NetworkFaults : public ::testing::Test, protected Story {
 protected:
  void begin_with(const Impairment& both_ways, std::uint64_t seed = 1) {
    begin({.link = {.up = both_ways, .down = both_ways, .seed = seed}});
  }
  void go_to_and_be_under_way(double setpoint_m) {
    go_to(setpoint_m);
    await(in_truth(motor_on()));
  }
  void await_connection(int number, Limit limit = {3}) { await(connections().is(number) and link_up(), limit); }
  void expect_still() { expect(in_truth(motor_off() and not in_auto())); }
  void expect_one_connection_and_no_link_loss() {
    expect(connections().is(1));
    expect_no_event("link_lost");
  }
};

TEST_F(NetworkFaults, WithoutFaultsTheLinkStaysUpAndNothingIsLost) {
  begin();
  pass(30);
  expect_one_connection_and_no_link_loss();
  expect_whole();
}

TEST_F(NetworkFaults, AnOutageOf3SecondsStopsTheMotorAfter1SecondAndLosesNoSample) {
  begin();
  go_to_and_be_under_way(0.5);
  outage(3);
  EXPECT_NEAR(await(in_truth(motor_off())), 1.0, 0.21) << "since the last heartbeat";
  expect(in_truth(link_lost() and in_manual()));
  await(link_lost(), {.limit_s = 0.25});
  await(link_up(), {.limit_s = 4});
  await(caught_up());
  expect_whole();
  expect_still();
  expect_events({"link_lost", "link_restored"});
  expect_no_event("link_lost");
  expect_no_event("link_restored");
}

// The ring's 8 s, less the 0.2 s since the last acknowledgement and the 1 s until the robot tries again.
TEST_F(NetworkFaults, AnOutageWithinTheRingLosesNothingWhenEverItBegins) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    begin_with({}, seed);
    pass(1 + 0.01 * static_cast<double>(seed));
    outage(6.7);
    await(link_lost());
    await(link_up(), {.limit_s = 8});
    await(caught_up(), {.limit_s = 8});
    expect_whole();
  }
}

TEST_F(NetworkFaults, AnOutageOf12SecondsOverrunsTheRingAndTheLostAreCounted) {
  begin();
  pass(2);
  outage(12);
  await(link_lost());
  await(link_up(), {.limit_s = 16});
  pass(1);
  await(caught_up(), {.limit_s = 15});
  pass(2);
  const std::uint64_t lost = station().lost_samples();
  EXPECT_GT(lost, 350u);  // 12 s and the time to dial, less the 8 s of the ring
  EXPECT_LT(lost, 650u);
  EXPECT_EQ(station().samples.size() + lost, station().durable_next_seq());
  // The robot counts what it gave up unacknowledged; some of that had arrived.
  EXPECT_GE(status().lost_samples, lost);
  EXPECT_LE(status().lost_samples, lost + 80);
}

TEST_F(NetworkFaults, AShortOutageLeavesTheLinkAsItIs) {
  begin();
  go_to(0.2);
  for (int i = 0; i < 5; ++i) {
    outage(0.3);
    pass(3);
  }
  expect(in_truth(in_auto()));
  expect_one_connection_and_no_link_loss();
  expect_whole();
}

TEST_F(NetworkFaults, AnOutageThatEndsInAResetIsDialledAgain) {
  begin();
  pass(1);
  suffer({.kind = FaultKind::link_outage, .for_s = 0.5, .then_reset = true});
  await_connection(2);
  expect_whole();
}

TEST_F(NetworkFaults, ACutInMidFrameLosesNothing) {
  begin_with({.delay_s = 0.03});
  for (int i = 2; i <= 11; ++i) {
    pass(0.51 + 0.01 * i);
    suffer({.kind = FaultKind::link_cut, .after_bytes = static_cast<std::uint64_t>(i % 4)});
    await_connection(i);
  }
  EXPECT_EQ(status().bad_frames, 0u);
  expect_whole();
}

TEST_F(NetworkFaults, ACutEndsNoAutoWhenTheRobotIsBackWithinTheTimeout) {
  begin();
  go_to(0.2);
  link().cut();
  await_connection(2, {.limit_s = 2});
  pass(1);
  expect(in_truth(in_auto()));
  expect_no_event("link_lost");
}

TEST_F(NetworkFaults, AResetLosesNothing) {
  begin_with({.delay_s = 0.05});
  for (int i = 2; i <= 6; ++i) {
    pass(1);
    suffer({.kind = FaultKind::link_reset});
    EXPECT_FALSE(link().robot_is_connected());
    await_connection(i);
  }
  expect_whole();
}

TEST_F(NetworkFaults, HalfOpenIsFoundByBothSidesAndTheRobotDialsAgain) {
  for (const Direction direction : {Direction::both, Direction::up, Direction::down}) {
    begin();
    go_to_and_be_under_way(0.2);
    suffer({.kind = FaultKind::link_half_open, .direction = direction});
    if (direction == Direction::up) {  // the station hears nothing, closes, and the robot hears that and dials
      await(link_lost(), {.limit_s = 1.2});
      EXPECT_FALSE(station().is_connected());
    } else {
      await(in_truth(motor_off() and link_lost()), {.limit_s = 1.2});
    }
    if (direction == Direction::both) EXPECT_LE(station().silence_us(), 1'300'000u);
    await_connection(2, {.limit_s = 4});
    await(caught_up(), {.limit_s = 10});
    expect_whole();
  }
}

TEST_F(NetworkFaults, HalfOpenTowardsTheStationIsSilenceThere) {
  begin();
  suffer({.kind = FaultKind::link_half_open});
  await(link_lost(), {.limit_s = 1.2});
}

TEST_F(NetworkFaults, SplitAtEveryByteEverythingWorks) {
  begin_with({.split_bytes = 1});
  go_to_and_be_under_way(0.1);
  pass(5);
  send(emergency_stop()).expect_accepted({.limit_s = 0.1});
  expect(in_truth(in_emergency()) and connections().is(1));
  EXPECT_EQ(status().bad_frames, 0u);
  expect_whole();
}

TEST_F(NetworkFaults, Delay300MsWithJitterKeepsTheLink) {
  begin_with({.delay_s = 0.3, .jitter_s = 0.2});
  go_to(0.1);
  pass(30);
  expect(in_truth(in_auto()));
  expect_one_connection_and_no_link_loss();
  expect_whole();
}

TEST_F(NetworkFaults, BackfillNeverStarvesLiveOnALinkOfTheLiveRate) {
  begin();
  pass(1);
  outage(5);
  await(link_lost(), {.limit_s = 2});
  link().impair({.bytes_per_s = 5500, .buffer_bytes = 2048}, {});  // live needs about 3.7 kB/s, backfill 6 more
  await(link_up(), {.limit_s = 8});
  pass(1);
  std::uint64_t oldest_live_us = 0;
  for (int i = 0; i < 300; ++i) {
    pass(0.01);
    const std::uint64_t newest_us = station().samples.rbegin()->second.robot_time_us;
    oldest_live_us = std::max(oldest_live_us, robot().robot_clock_us() - newest_us);
  }
  EXPECT_LT(oldest_live_us, 900'000u);
  EXPECT_GT(station().durable_next_seq(), 0u);
  await(caught_up(), {.limit_s = 60});
  expect_whole();
}

TEST_F(NetworkFaults, LossAsStallsBelowTheTimeoutKeepsTheLink) {
  begin_with({.loss_probability = 0.05}, 4);
  go_to(0.1);
  pass(20);
  expect(in_truth(in_auto()) and connections().is(1));
  expect_whole();
}

TEST_F(NetworkFaults, ADeadlineThatPassesInAStallIsKept) {
  begin();
  outage(0.5);  // what is sent 0.1 s into it arrives 0.6 s later, within the link time-out
  pass(0.1);
  protocol::Command late = set_duty(0.5F);
  late.valid_until_robot_us = station().robot_time_us() + 300'000;
  const Sent late_duty = send(late), stop_without_deadline = send(emergency_stop());
  late_duty.expect_refused("expired", {.limit_s = 2.5});
  stop_without_deadline.expect_accepted();
  pass(1);
  expect(in_truth(in_emergency()) and connections().is(1));
}

TEST_F(NetworkFaults, AManualDutyEndsWithItsLeaseInAStall) {
  begin();
  start_driving(0.4);
  holds(in_truth(motor_on()), {.for_s = 1.5});
  outage(2);
  await(in_truth(motor_off()), {.limit_s = 0.7});
}

TEST_F(NetworkFaults, AHandshakeBlocksTheRobotAtRestAndItsMissedTicksAreCounted) {
  begin({.link = {.up = {}, .down = {}, .handshake_s = 5}});
  pass(1.5);
  EXPECT_NEAR(status().missed_ticks, 500, 2);
  go_to_and_be_under_way(0.5);
  link().cut();
  await(in_truth(motor_off()), {.limit_s = 1.21});
  EXPECT_FALSE(robot().is_blocked()) << "the motor goes off with the link, and only then the robot dials";
  holds(in_truth(motor_off()), {.for_s = 5});
  await(connections().is(2));
  pass(3);
  EXPECT_NEAR(status().missed_ticks, 1000, 4);
  expect_still();
  expect_events({"time_step", "time_step"});
}

TEST_F(NetworkFaults, TheSameSeedGivesTheSameStory) {
  const auto frames_received = [this](std::uint64_t seed) {
    begin_with({.jitter_s = 0.1, .loss_probability = 0.2}, seed);
    std::vector<std::size_t> received;
    for (int i = 0; i < 1000; ++i) {
      pass(0.01);
      received.push_back(station().frames.size());
    }
    return received;
  };
  EXPECT_EQ(frames_received(3), frames_received(3));
  EXPECT_NE(frames_received(3), frames_received(4));
}

}  // namespace
}  // namespace sim_robot
