// What subscribers hear, and what happens to those who listen too slowly.
#include "server/live/live_feed.hpp"

#include <algorithm>

#include "tests/server/api/live_feed_fixture.hpp"

namespace server {
namespace {

class LiveFeedTest : public LiveFeedFixture {};

TEST_F(LiveFeedTest, StampsTenTimesASecond) {
  clock.run_for(1s);
  const auto all = received();
  ASSERT_EQ(all.size(), 10U);
  EXPECT_EQ(all.back()["stamp_us"], clock.steady_us());
}

TEST_F(LiveFeedTest, SendsLinkModeAndEmergencyAtOnceAndTheRestWithTheNextStamp) {
  live.on_robot(robot);
  EXPECT_EQ(types(), Types{"robot"});
  robot.durable_next_seq = 5;
  robot.fluid = "water";
  live.on_robot(robot);
  robot.durable_next_seq = 6;
  live.on_robot(robot);
  EXPECT_EQ(types(), Types{});
  clock.run_for(100ms);
  const auto later = received();
  ASSERT_EQ(later.size(), 2U);
  EXPECT_EQ(later[0]["robot"]["durable_next_seq"], 6);
  robot.context.emergency_id = 9;
  live.on_samples(robot, batch(0));
  EXPECT_EQ(types(), (Types{"robot", "samples"}));
}

TEST_F(LiveFeedTest, WhileOnlyNumbersAdvanceAStateIsSentTwiceASecond) {
  live.on_robot(robot);
  received();
  Types sent;
  for (int round = 0; round < 20; ++round) {
    robot.durable_next_seq += 10;
    robot.context.position_sd_m = 0.001F * static_cast<float>(round);
    live.on_robot(robot);
    clock.run_for(100ms);
    for (const auto& message : received()) {
      if (message["type"] == "robot") EXPECT_EQ(message["robot"]["durable_next_seq"], robot.durable_next_seq);
      sent.push_back(message["type"]);
    }
  }
  EXPECT_EQ(std::ranges::count(sent, "robot"), 4);
  EXPECT_EQ(std::ranges::count(sent, "stamp"), 20);
  robot.control.holder = "user:ada";
  live.on_robot(robot);
  clock.run_for(100ms);
  EXPECT_EQ(received()[0]["robot"]["control"]["holder"], "user:ada") << "of what people wait for, with the next stamp";
  robot.next_seq += 5;  // and the last of it is not forgotten
  live.on_robot(robot);
  clock.run_for(600ms);
  EXPECT_EQ(std::ranges::count(types(), "robot"), 1);
}

// A page that begins to watch does not wait for the half second of another.
TEST_F(LiveFeedTest, WhoBeginsToWatchReceivesTheNextChangeWithTheNextStamp) {
  live.watch(listener, {"r1"});
  live.on_robot(robot);
  clock.run_for(100ms);
  live::Subscriber other{loop};
  live.watch(other, {"r1"});
  robot.next_seq += 5;
  live.on_robot(robot);
  clock.run_for(100ms);
  EXPECT_EQ(other.size(), 2U) << "state and stamp";
  live.remove(other);
}

TEST_F(LiveFeedTest, NeverSendsAnOlderStateAfterANewerOne) {
  live.on_robot(robot);
  live.on_robot(robot);  // waits for the stamp
  robot.context.setpoint_m = 0.1F;
  live.on_samples(robot, batch(0));
  received();
  clock.run_for(100ms);
  EXPECT_EQ(received()[0]["robot"]["setpoint_m"], 0.1);
}

TEST_F(LiveFeedTest, WritesSamplesAsColumns) {
  robot.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
  live.on_samples(robot, batch(7));
  const json samples = received().at(1);
  EXPECT_EQ(samples["boot_id"], "18364758544493064720");
  EXPECT_EQ(samples["first_seq"], 7);
  EXPECT_EQ(samples["position_m"], (json{0.1, 0.2}));
  EXPECT_EQ(samples["duty"], (json{-0.5, 0.0}));
  EXPECT_EQ(samples["setpoint_m"], nullptr);
  EXPECT_EQ(samples["backfill"], true);
}

// A page costs the same few messages a second, whether its robot sends each sample by itself or many at once.
TEST_F(LiveFeedTest, GathersSamplesUntilTheyAreFiftyMilliseconds) {
  live.on_robot(robot);
  received();
  const auto one = [&](std::uint64_t seq) {
    station::SampleBatch made = batch(seq);
    made.first_robot_time_us = 25'000 * seq;
    made.samples.resize(1);
    return made;
  };
  live.on_samples(robot, one(0));
  EXPECT_EQ(types(), Types{});
  live.on_samples(robot, one(1));
  const auto both = received();
  EXPECT_EQ(both.at(0)["first_seq"], 0);
  EXPECT_EQ(both[0]["position_m"], (json{0.1, 0.1}));

  live.on_samples(robot, one(2));
  live.on_samples(robot, one(4));  // not the next
  EXPECT_EQ(received().at(0)["first_seq"], 2);
  station::SampleBatch shifted = one(5);
  shifted.first_robot_time_us += 1;
  live.on_samples(robot, shifted);  // at another time than it seems
  EXPECT_EQ(received().at(0)["first_seq"], 4);
  station::SampleBatch other = one(6);
  other.first_robot_time_us += 1;
  other.context.setpoint_m = 0.3F;
  live.on_samples(robot, other);  // under other conditions
  EXPECT_EQ(received().at(0)["first_seq"], 5);
  station::SampleBatch rebooted = other;
  rebooted.boot_id = 1;
  rebooted.first_seq = 7;
  rebooted.first_robot_time_us += 25'000;
  live.on_samples(robot, rebooted);  // of another boot
  EXPECT_EQ(received().at(0)["first_seq"], 6);

  clock.run_for(200ms);  // and what no further sample follows
  const auto late = received();
  EXPECT_EQ(late.at(0)["first_seq"], 7);
  robot.context.emergency_id = 9;
  live.on_samples(robot, one(8));
  EXPECT_EQ(types(), (Types{"robot", "samples"})) << "at once";
  live.on_samples(robot, one(9));
  robot.context.emergency_id = 10;
  live.on_robot(robot);
  EXPECT_EQ(types(), (Types{"samples", "robot"})) << "in the order in which it happened";
}

TEST_F(LiveFeedTest, OfWhatItDoesNotWatchAPageReceivesLargeChangesWithTheNextStamp) {
  station::RobotState other = robot;
  other.id = "r2";
  live.on_robot(robot);
  live.on_robot(other);
  received();
  live.watch(listener, {"r1"});
  robot.context.emergency_id = other.context.emergency_id = 9;
  live.on_robot(robot);
  live.on_robot(other);
  EXPECT_EQ(types(), Types{"robot"}) << "of the one that it watches, at once";
  other.durable_next_seq = 7;
  live.on_robot(other);
  live.on_samples(other, batch(0));
  EXPECT_EQ(types(), Types{});
  clock.run_for(100ms);
  const auto messages = received();
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0]["robot"]["emergency_id"], "9");
  EXPECT_EQ(messages[0]["robot"]["durable_next_seq"], 7);
  other.durable_next_seq = 8;
  live.on_robot(other);
  clock.run_for(100ms);
  EXPECT_EQ(types(), Types{"stamp"}) << "nothing of small changes";
}

TEST_F(LiveFeedTest, APageThatBeginsToWatchBeforeTheStampReceivesWhatChanged) {
  live.watch(listener, {});
  live.on_robot(robot);
  live.watch(listener, {"r1"});
  live.on_robot(robot);  // as the station does for each that is watched
  clock.run_for(100ms);
  EXPECT_EQ(types(), (Types{"robot", "stamp"}));
}

// However many robots change at once, the stamp is in time: it is what pages show that they are there by.
TEST_F(LiveFeedTest, AStampIsInTimeWhenAVeryLargeFleetChanges) {
  clock.settle();
  live.watch(listener, {});
  for (int i = 0; i < 500; ++i) {
    robot.id = "fleet-" + std::to_string(i);
    live.on_robot(robot);
  }
  std::vector<std::size_t> messages;
  for (int stamp = 0; stamp < 4; ++stamp) {
    clock.run_for(100ms);
    const auto all = received();
    const auto is_in_time = [&](const json& one) {
      return one.value("stamp_us", std::int64_t{0}) == clock.steady_us();
    };
    EXPECT_EQ(std::ranges::count_if(all, is_in_time), 1);
    messages.push_back(all.size() - 1);
  }
  EXPECT_EQ(messages, (std::vector<std::size_t>{200, 200, 100, 0}));
}

TEST_F(LiveFeedTest, SamplesOfALargeChangeDoNotWaitForMore) {
  live.on_robot(robot);
  station::SampleBatch one = batch(0);
  one.samples.resize(1);
  robot.context.mode = one.context.mode = rheonaut_MODE_AUTO;
  received();
  live.on_samples(robot, one);
  EXPECT_EQ(types(), (Types{"robot", "samples"}));
}

TEST_F(LiveFeedTest, SamplesThatWereGatheredForWhoLeftAreForgotten) {
  live.on_robot(robot);
  station::SampleBatch one = batch(0);
  one.samples.resize(1);
  live.on_samples(robot, one);
  live.watch(listener, {});
  live.watch(listener, {"r1"});
  received();
  live.on_samples(robot, batch(10));
  const auto messages = received();
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_EQ(messages[0]["first_seq"], 10);
}

// Pages may name what they like: what they named is forgotten with them.
TEST_F(LiveFeedTest, ARobotThatIsWatchedNeedNotBeKnown) {
  for (int i = 0; i < 1000; ++i) live.watch(listener, {"nobody-" + std::to_string(i), "r1"});
  live.on_robot(robot);
  live.on_samples(robot, batch(0));
  EXPECT_EQ(types(), (Types{"robot", "samples"}));
  EXPECT_LE(live.robots(), 2U);
  live.remove(listener);
  live.on_samples(robot, batch(2));
  EXPECT_EQ(types(), Types{});
}

TEST_F(LiveFeedTest, APageThatNamedItsRobotsReceivesOneLogWithEachStamp) {
  live::Subscriber all{loop};
  live.add(all);
  live.watch(listener, {});
  station::CommandRecord command;
  command.robot_id = "r1";
  for (const station::CommandId id : std::vector<station::CommandId>{1, 2, 1}) {
    command.id = id;
    live.on_command(command);
  }
  live.on_event(robot, {});
  EXPECT_EQ(listener.size(), 0U);
  EXPECT_EQ(all.size(), 4U);
  clock.run_for(100ms);
  const auto messages = received();
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0]["type"], "log");
  EXPECT_EQ(messages[0]["events"].size(), 1U);
  ASSERT_EQ(messages[0]["commands"].size(), 2U) << "the newest record of each";
  EXPECT_EQ(messages[0]["commands"][1]["command_id"], "1");
  EXPECT_EQ(all.size(), 5U) << "and the stamp; a page that watches all received it already";
  for (station::CommandId id = 1; id <= 64; ++id) {
    command.id = id;
    live.on_command(command);
  }
  EXPECT_EQ(types(), Types{"log"}) << "what is long enough waits for no stamp";
  live.remove(all);
}

TEST_F(LiveFeedTest, WritesOneTextForAll) {
  live::Subscriber other{loop};
  live.add(other);
  live.on_event(robot, {});
  EXPECT_EQ(listener.pop().get(), other.pop().get());
  live.remove(other);
  live.on_event(robot, {});
  EXPECT_EQ(other.pop(), nullptr);
}

TEST_F(LiveFeedTest, ASlowListenerLosesTheOldestSamplesAndReceivesHowMany) {
  live.on_robot(robot);
  station::CommandRecord stop;
  stop.kind = "emergency_stop";
  live.on_command(stop);
  for (std::uint64_t i = 0; i < 1000; ++i) live.on_samples(robot, batch(2 * i));
  EXPECT_EQ(listener.size(), live::Subscriber::kMaxMessages + 1);  // the robot's state is not counted
  const auto all = received();
  ASSERT_EQ(all.size(), live::Subscriber::kMaxMessages + 2);
  EXPECT_EQ(all[0]["type"], "dropped");
  EXPECT_EQ(all[0]["count"], 1001 - live::Subscriber::kMaxMessages);
  EXPECT_EQ(all[1]["type"], "robot");
  EXPECT_EQ(all[2]["type"], "command");
  EXPECT_EQ(all.back()["first_seq"], 2 * 999);
  live.on_samples(robot, batch(0));
  EXPECT_EQ(types(), Types{"samples"});
}

// A page that reads nothing holds one state of each robot, the newest, in the place of the first.
TEST_F(LiveFeedTest, OfEachRobotOneStateWaits) {
  station::RobotState other = robot;
  other.id = "r2";
  live.on_robot(robot);
  live.on_robot(other);
  for (std::uint64_t seq = 1; seq <= 10; ++seq) {
    robot.durable_next_seq = seq;
    robot.invalid_values = seq;  // published with the next stamp
    live.on_robot(robot);
    clock.run_for(100ms);
  }
  std::vector<json> states = received();
  std::erase_if(states, [](const json& one) { return one["type"] != "robot"; });
  ASSERT_EQ(states.size(), 2U);
  EXPECT_EQ(states[0]["robot"]["robot_id"], "r1");
  EXPECT_EQ(states[0]["robot"]["durable_next_seq"], 10);
  EXPECT_EQ(states[1]["robot"]["robot_id"], "r2");
}

// SAFETY: neither states nor samples nor commands push the news of an emergency out of a slow page's queue.
TEST_F(LiveFeedTest, AHeadlineIsNeverDropped) {
  robot.context.emergency_id = 9;
  live.on_robot(robot);
  station::RobotState fleet = robot;
  for (std::size_t i = 0; i < 2 * live::Subscriber::kMaxMessages; ++i) {
    fleet.id = "fleet-" + std::to_string(i);
    live.on_robot(fleet);
    live.on_samples(robot, batch(2 * i));
    live.on_command({});
  }
  EXPECT_EQ(listener.size(), 3 * live::Subscriber::kMaxMessages + 1);
  const auto all = received();
  EXPECT_EQ(all[0]["type"], "dropped");
  EXPECT_EQ(all[1]["robot"]["emergency_id"], "9");
  const auto is_state = [](const json& one) { return one["type"] == "robot"; };
  EXPECT_EQ(std::ranges::count_if(all, is_state), 2 * live::Subscriber::kMaxMessages + 1);
}

// However large the fleet, the loop has turns between a few robots and the next, and the page receives all before the
// stamp.
TEST_F(LiveFeedTest, AFleetIsSentInTurnsOfTheLoop) {
  clock.settle();
  constexpr std::size_t kFleet = 200;
  const auto change = [&] {
    for (std::size_t i = 0; i < kFleet; ++i) {
      robot.id = "fleet-" + std::to_string(i);
      live.on_robot(robot);
    }
  };
  change();
  received();
  change();
  std::size_t most = 0;
  clock.advance_to_next();
  while (loop.poll_one() > 0) most = std::max(most, types().size());
  EXPECT_GT(most, 0U);
  EXPECT_LE(most, 20U);
}

// A change while the fleet is being sent is sent once, the newer state last.
TEST_F(LiveFeedTest, WhatChangesBetweenTwoTurnsIsSentAfterwards) {
  clock.settle();
  std::vector<station::RobotState> fleet(40, robot);
  for (std::size_t i = 0; i < fleet.size(); ++i) fleet[i].id = "fleet-" + std::to_string(10 + i);
  for (int i = 0; i < 2; ++i) {
    for (const station::RobotState& one : fleet) live.on_robot(one);
    if (i == 0) received();
  }
  clock.advance_to_next();
  std::vector<json> messages;
  const auto listen = [&] {
    for (const json& one : received()) {
      if (one["type"] == "robot") messages.push_back(one["robot"]);
    }
  };
  while (messages.empty() && loop.poll_one() > 0) listen();
  ASSERT_LT(messages.size(), fleet.size());
  fleet.front().durable_next_seq = fleet.back().durable_next_seq = 7;
  fleet.front().fluid = "water";  // more than progress, which would wait
  live.on_robot(fleet.front());   // was sent: again with the next stamp
  live.on_robot(fleet.back());    // was not: once, as it is now
  clock.settle();
  listen();
  EXPECT_EQ(messages.size(), fleet.size());
  EXPECT_EQ(messages.back()["durable_next_seq"], 7);
  clock.run_for(100ms);
  listen();
  ASSERT_EQ(messages.size(), fleet.size() + 1);
  EXPECT_EQ(messages.back()["robot_id"], fleet.front().id);
  EXPECT_EQ(messages.back()["durable_next_seq"], 7);
}

}  // namespace
}  // namespace server
