// What each fault of the network makes of the robot and of the least of a station, as docs/network_faults.md says.
#include "tests/sim_robot/link_story.hpp"

namespace sim_robot {
namespace {

using NetworkFaults = LinkStory;

LinkOptions both_ways(const Impairment& impairment) { return {impairment, impairment}; }

TEST_F(NetworkFaults, WithoutFaultsTheLinkStaysUpAndNothingIsLost) {
  begin();
  station->run(30);
  EXPECT_EQ(link->connections(), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 0);
  expect_whole();
}

TEST_F(NetworkFaults, AnOutageOf3SecondsStopsTheMotorAfter1SecondAndLosesNoSample) {
  begin();
  ASSERT_TRUE(reached_auto(0.5F));
  link->outage(3);
  EXPECT_NEAR(time_to([&] { return core().duty() == 0; }, 2), 1.0, 0.21);  // since the last heartbeat
  EXPECT_TRUE(core().link_lost());
  EXPECT_EQ(core().mode(), rheonaut_MODE_MANUAL);
  EXPECT_LE(time_to([&] { return station->link_is_lost(); }, 2), 0.25);
  EXPECT_LT(time_to([&] { return station->link_is_up(); }, 5), 4.0);
  EXPECT_TRUE(run_until([&] { return caught_up(); }, 5));
  expect_whole();
  expect_still();
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_RESTORED), 1);
}

TEST_F(NetworkFaults, AnOutageOf12SecondsOverrunsTheRingAndTheLostAreCounted) {
  begin();
  station->run(2);
  link->outage(12);
  ASSERT_TRUE(run_until([&] { return station->link_is_lost(); }, 2));
  ASSERT_TRUE(run_until([&] { return station->link_is_up(); }, 16));
  station->run(1);
  ASSERT_TRUE(run_until([&] { return caught_up(); }, 15));
  station->run(2);
  EXPECT_GT(station->lost_samples(), 350u);  // 12 s and the time to dial, less the 8 s of the ring
  EXPECT_LT(station->lost_samples(), 650u);
  EXPECT_EQ(station->samples.size() + station->lost_samples(), station->durable_next_seq());
  // The robot counts what it gave up unacknowledged; some of that had arrived.
  EXPECT_GE(status().lost_samples, station->lost_samples());
  EXPECT_LE(status().lost_samples, station->lost_samples() + 80);
}

TEST_F(NetworkFaults, AShortOutageLeavesTheLinkAsItIs) {
  begin();
  ASSERT_TRUE(reached_auto(0.2F));
  for (int i = 0; i < 5; ++i) {
    link->outage(0.3);
    station->run(3);
  }
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  EXPECT_EQ(link->connections(), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 0);
  expect_whole();
}

TEST_F(NetworkFaults, AnOutageThatEndsInAResetIsDialledAgain) {
  begin();
  station->run(1);
  link->outage(0.5, true);
  ASSERT_TRUE(run_until([&] { return link->connections() == 2 && station->link_is_up(); }, 3));
  expect_whole();
}

TEST_F(NetworkFaults, ACutInMidFrameLosesNothing) {
  LinkOptions options;
  options.up.delay_s = options.down.delay_s = 0.03;
  begin(options);
  for (int i = 2; i <= 11; ++i) {
    station->run(0.51 + 0.01 * i);
    link->cut(static_cast<std::size_t>(i % 4));
    ASSERT_TRUE(run_until([&] { return link->connections() == i && station->link_is_up(); }, 3));
  }
  EXPECT_EQ(status().bad_frames, 0u);
  expect_whole();
}

TEST_F(NetworkFaults, ACutEndsNoAutoWhenTheRobotIsBackWithinTheTimeout) {
  begin();
  ASSERT_TRUE(reached_auto(0.2F));
  link->cut();
  ASSERT_TRUE(run_until([&] { return link->connections() == 2 && station->link_is_up(); }, 2));
  station->run(1);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 0);
}

TEST_F(NetworkFaults, AResetLosesNothing) {
  LinkOptions options;
  options.up.delay_s = options.down.delay_s = 0.05;
  begin(options);
  for (int i = 2; i <= 6; ++i) {
    station->run(1);
    link->reset();
    EXPECT_FALSE(link->robot_is_connected());
    ASSERT_TRUE(run_until([&] { return link->connections() == i && station->link_is_up(); }, 3));
  }
  expect_whole();
}

TEST_F(NetworkFaults, HalfOpenIsFoundByBothSidesAndTheRobotDialsAgain) {
  for (const Direction direction : {Direction::both, Direction::up, Direction::down}) {
    begin();
    ASSERT_TRUE(reached_auto(0.2F));
    const int before = link->connections();
    link->half_open(direction);
    const bool robot_is_deaf = direction != Direction::up;
    if (robot_is_deaf) {
      EXPECT_LE(time_to([&] { return core().duty() == 0; }, 3), 1.2);
      EXPECT_TRUE(core().link_lost());
    } else {  // the station hears nothing, closes, and the robot, which hears that, dials again at once
      EXPECT_LE(time_to([&] { return !station->is_connected(); }, 3), 1.2);
    }
    if (direction == Direction::both) EXPECT_LE(station->silence_us(), 1'300'000u);
    ASSERT_TRUE(run_until([&] { return link->connections() > before && station->link_is_up(); }, 4));
    ASSERT_TRUE(run_until([&] { return caught_up(); }, 10));
    expect_whole();
    station.reset();
    link->reset();
    link.reset();
    life.reboot({});
    life.advance_to(life.true_us() + 1'000'000);
  }
}

TEST_F(NetworkFaults, HalfOpenTowardsTheStationIsSilenceThere) {
  begin();
  link->half_open(Direction::both);
  const double begin_s = now_s();
  ASSERT_TRUE(run_until([&] { return station->link_is_lost(); }, 3));
  EXPECT_LE(now_s() - begin_s, 1.2);
}

TEST_F(NetworkFaults, SplitAtEveryByteEverythingWorks) {
  Impairment split;
  split.split_bytes = 1;
  begin(both_ways(split));
  ASSERT_TRUE(reached_auto(0.1F));
  station->run(5);
  const auto stop = station->send(emergency_stop());
  station->run(0.1);
  EXPECT_EQ(answer(stop), "accepted");
  EXPECT_EQ(core().mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(link->connections(), 1);
  EXPECT_EQ(status().bad_frames, 0u);
  expect_whole();
}

TEST_F(NetworkFaults, Delay300MsWithJitterKeepsTheLink) {
  Impairment slow;
  slow.delay_s = 0.3;
  slow.jitter_s = 0.2;
  begin(both_ways(slow));
  ASSERT_TRUE(reached_auto(0.1F));
  station->run(30);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  EXPECT_EQ(link->connections(), 1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_LINK_LOST), 0);
  expect_whole();
}

TEST_F(NetworkFaults, BackfillNeverStarvesLiveOnALinkOfTheLiveRate) {
  begin();
  station->run(1);
  link->outage(5);
  ASSERT_TRUE(run_until([&] { return station->link_is_lost(); }, 2));
  Impairment throttle;
  throttle.bytes_per_s = 5500;  // live needs about 3.7 kB/s, backfill would take 6 more
  throttle.buffer_bytes = 2048;
  link->impair(throttle, {});
  ASSERT_TRUE(run_until([&] { return station->link_is_up(); }, 8));
  station->run(1);
  std::uint64_t oldest_live_us = 0;
  for (int i = 0; i < 300; ++i) {
    station->step();
    const std::uint64_t newest_us = station->samples.rbegin()->second.robot_time_us;
    oldest_live_us = std::max(oldest_live_us, life.robot_clock_us() - newest_us);
  }
  EXPECT_LT(oldest_live_us, 900'000u);
  EXPECT_GT(station->durable_next_seq(), 0u);
  ASSERT_TRUE(run_until([&] { return caught_up(); }, 60));
  expect_whole();
}

TEST_F(NetworkFaults, LossAsStallsBelowTheTimeoutKeepsTheLink) {
  Impairment lossy;
  lossy.loss_probability = 0.05;
  LinkOptions options = both_ways(lossy);
  options.seed = 4;
  begin(options);
  ASSERT_TRUE(reached_auto(0.1F));
  station->run(20);
  EXPECT_EQ(core().mode(), rheonaut_MODE_AUTO);
  EXPECT_EQ(link->connections(), 1);
  expect_whole();
}

TEST_F(NetworkFaults, ADeadlineThatPassesInAStallIsKept) {
  begin();
  link->outage(0.5);  // what is sent 0.1 s into it arrives 0.6 s later, within the link time-out
  station->run(0.1);
  protocol::Command late = set_duty(0.5F);
  late.valid_until_robot_us = station->robot_time_us() + 300'000;
  const auto late_id = station->send(late);
  const auto stop_id = station->send(emergency_stop());
  station->run(2.5);
  EXPECT_EQ(answer(late_id), "expired");
  EXPECT_EQ(answer(stop_id), "accepted") << "a stop has no deadline";
  EXPECT_EQ(core().mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(link->connections(), 1);
}

TEST_F(NetworkFaults, AManualDutyEndsWithItsLeaseInAStall) {
  begin();
  ASSERT_GT(drive_until_it_stops(0.4F, 1.5), 1.4) << "renewed, it goes on";
  link->outage(2);
  EXPECT_LE(drive_until_it_stops(0.4F, 3), 0.7);
}

TEST_F(NetworkFaults, AHandshakeBlocksTheRobotAtRestAndItsMissedTicksAreCounted) {
  LinkOptions options;
  options.handshake_s = 5;
  begin(options);
  station->run(1.5);
  EXPECT_NEAR(status().missed_ticks, 500, 2);
  ASSERT_TRUE(reached_auto(0.5F));
  link->cut();
  double longest_on_s = 0;
  const double cut_s = now_s();
  while (link->connections() == 1 && now_s() < cut_s + 12) {
    if (core().duty() != 0) longest_on_s = now_s() - cut_s;
    if (life.is_blocked()) EXPECT_EQ(core().duty(), 0);
    station->step();
  }
  EXPECT_LE(longest_on_s, 1.21) << "the motor goes off with the link, and only then the robot dials";
  station->run(3);
  EXPECT_NEAR(status().missed_ticks, 1000, 4);
  expect_still();
  EXPECT_GE(events_of(rheonaut_EVENT_KIND_TIME_STEP), 2);
}

TEST_F(NetworkFaults, TheSameSeedTellsTheSameStory) {
  const auto story = [](std::uint64_t seed) {
    RobotLife life{{}};
    LinkOptions options;
    options.up.jitter_s = options.down.jitter_s = 0.1;
    options.up.loss_probability = options.down.loss_probability = 0.2;
    options.seed = seed;
    ImpairedLink link{life, options};
    LinkedPeer station{link};
    std::vector<std::size_t> heard;
    for (int i = 0; i < 1000; ++i) {
      station.step();
      heard.push_back(station.frames.size());
    }
    return heard;
  };
  EXPECT_EQ(story(3), story(3));
  EXPECT_NE(story(3), story(4));
}

}  // namespace
}  // namespace sim_robot
