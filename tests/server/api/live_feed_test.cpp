// What subscribers hear, and what happens to those who listen too slowly.
#include "server/live/live_feed.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

LiveText message(const std::string& text) { return std::make_shared<const std::string>(text); }

class LiveFeedTest : public ::testing::Test {
 public:
  LiveFeedTest() {
    robot.id = "r1";
    robot.link = LinkState::connected;
    robot.boot_id = 0xfedcba9876543210;
    robot.context.mode = rheonaut_MODE_MANUAL;
    live.add(listener);
    tasks.spawn("live feed", live.run());
  }
  ~LiveFeedTest() override {
    tasks.stop();
    clock.settle();
  }

 protected:
  std::vector<json> heard() {
    std::vector<json> all;
    for (LiveText text = listener.pop(); text != nullptr; text = listener.pop()) all.push_back(json::parse(*text));
    return all;
  }
  std::vector<std::string> types() {
    std::vector<std::string> all;
    for (const json& one : heard()) all.push_back(one["type"]);
    return all;
  }
  SampleBatch batch(std::uint64_t first_seq) const {
    SampleBatch made;
    made.robot_id = robot.id;
    made.boot_id = robot.boot_id;
    made.first_seq = first_seq;
    made.context = robot.context;
    made.samples = {{.position_m = 0.1F, .duty = -0.5F}, {.position_m = 0.2F, .impedance_mv = 175}};
    return made;
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  TaskGroup tasks{loop};
  LiveFeed live{clock};
  Subscriber listener{loop};
  RobotState robot;
};

using Types = std::vector<std::string>;

TEST_F(LiveFeedTest, StampsTenTimesASecond) {
  clock.run_for(1s);
  const auto all = heard();
  ASSERT_EQ(all.size(), 10U);
  EXPECT_EQ(all.back()["stamp_us"], clock.steady_us());
}

TEST_F(LiveFeedTest, TellsLinkModeAndEmergencyAtOnceAndTheRestWithTheNextStamp) {
  live.on_robot(robot);
  EXPECT_EQ(types(), Types{"robot"});
  robot.durable_next_seq = 5;
  live.on_robot(robot);
  robot.durable_next_seq = 6;
  live.on_robot(robot);
  EXPECT_EQ(types(), Types{});
  clock.run_for(100ms);
  const auto later = heard();
  ASSERT_EQ(later.size(), 2U);
  EXPECT_EQ(later[0]["robot"]["durable_next_seq"], 6);
  robot.context.emergency_id = 9;
  live.on_samples(robot, batch(0));
  EXPECT_EQ(types(), (Types{"robot", "samples"}));
}

TEST_F(LiveFeedTest, NeverTellsAnOlderStateAfterANewerOne) {
  live.on_robot(robot);
  live.on_robot(robot);  // waits for the stamp
  robot.context.setpoint_m = 0.1F;
  live.on_samples(robot, batch(0));
  heard();
  clock.run_for(100ms);
  EXPECT_EQ(heard()[0]["robot"]["setpoint_m"], 0.1);
}

TEST_F(LiveFeedTest, WritesSamplesAsColumns) {
  robot.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
  live.on_samples(robot, batch(7));
  const json samples = heard().at(1);
  EXPECT_EQ(samples["boot_id"], "18364758544493064720");
  EXPECT_EQ(samples["first_seq"], 7);
  EXPECT_EQ(samples["position_m"], (json{0.1, 0.2}));
  EXPECT_EQ(samples["duty"], (json{-0.5, 0.0}));
  EXPECT_EQ(samples["setpoint_m"], nullptr);
  EXPECT_EQ(samples["backfill"], true);
}

TEST_F(LiveFeedTest, WritesOneTextForAll) {
  Subscriber other{loop};
  live.add(other);
  live.on_event(robot, {});
  EXPECT_EQ(listener.pop().get(), other.pop().get());
  live.remove(other);
  live.on_event(robot, {});
  EXPECT_EQ(other.pop(), nullptr);
}

TEST_F(LiveFeedTest, ASlowListenerLosesTheOldestSamplesAndHearsHowMany) {
  live.on_robot(robot);
  CommandRecord stop;
  stop.kind = "emergency_stop";
  live.on_command(stop);
  for (std::uint64_t i = 0; i < 1000; ++i) live.on_samples(robot, batch(2 * i));
  EXPECT_EQ(listener.size(), Subscriber::kMaxMessages + 1);  // the robot's state is not counted
  const auto all = heard();
  ASSERT_EQ(all.size(), Subscriber::kMaxMessages + 2);
  EXPECT_EQ(all[0]["type"], "dropped");
  EXPECT_EQ(all[0]["count"], 1001 - Subscriber::kMaxMessages);
  EXPECT_EQ(all[1]["type"], "robot");
  EXPECT_EQ(all[2]["type"], "command");
  EXPECT_EQ(all.back()["first_seq"], 2 * 999);
  live.on_samples(robot, batch(0));
  EXPECT_EQ(types(), Types{"samples"});
}

// A page that reads nothing holds one state of each robot, the newest, in the place of the first.
TEST_F(LiveFeedTest, OfEachRobotOneStateWaits) {
  RobotState other = robot;
  other.id = "r2";
  live.on_robot(robot);
  live.on_robot(other);
  for (std::uint64_t seq = 1; seq <= 10; ++seq) {
    robot.durable_next_seq = seq;
    live.on_robot(robot);
    clock.run_for(100ms);
  }
  std::vector<json> states = heard();
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
  RobotState fleet = robot;
  for (std::size_t i = 0; i < 2 * Subscriber::kMaxMessages; ++i) {
    fleet.id = "fleet-" + std::to_string(i);
    live.on_robot(fleet);
    live.on_samples(robot, batch(2 * i));
    live.on_command({});
  }
  EXPECT_EQ(listener.size(), 3 * Subscriber::kMaxMessages + 1);
  const auto all = heard();
  EXPECT_EQ(all[0]["type"], "dropped");
  EXPECT_EQ(all[1]["robot"]["emergency_id"], "9");
  const auto is_state = [](const json& one) { return one["type"] == "robot"; };
  EXPECT_EQ(std::ranges::count_if(all, is_state), 2 * Subscriber::kMaxMessages + 1);
}

// However large the fleet, the loop has turns between a few robots and the next, and the page hears all before the
// stamp.
TEST_F(LiveFeedTest, AFleetIsToldInTurnsOfTheLoop) {
  clock.settle();
  constexpr std::size_t kFleet = 200;
  const auto change = [&] {
    for (std::size_t i = 0; i < kFleet; ++i) {
      robot.id = "fleet-" + std::to_string(i);
      live.on_robot(robot);
    }
  };
  change();
  heard();
  change();
  std::size_t most = 0;
  clock.advance_to_next();
  while (loop.poll_one() > 0) most = std::max(most, types().size());
  EXPECT_GT(most, 0U);
  EXPECT_LE(most, 20U);
}

// What changes while the fleet is told is told once, the newer state last.
TEST_F(LiveFeedTest, WhatChangesBetweenTwoTurnsIsToldAfterwards) {
  clock.settle();
  std::vector<RobotState> fleet(40, robot);
  for (std::size_t i = 0; i < fleet.size(); ++i) fleet[i].id = "fleet-" + std::to_string(10 + i);
  for (int i = 0; i < 2; ++i) {
    for (const RobotState& one : fleet) live.on_robot(one);
    if (i == 0) heard();
  }
  clock.advance_to_next();
  std::vector<json> told;
  const auto listen = [&] {
    for (const json& one : heard()) {
      if (one["type"] == "robot") told.push_back(one["robot"]);
    }
  };
  while (told.empty() && loop.poll_one() > 0) listen();
  ASSERT_LT(told.size(), fleet.size());
  fleet.front().durable_next_seq = fleet.back().durable_next_seq = 7;
  live.on_robot(fleet.front());  // was told: again with the next stamp
  live.on_robot(fleet.back());   // was not: once, as it is now
  clock.settle();
  listen();
  EXPECT_EQ(told.size(), fleet.size());
  EXPECT_EQ(told.back()["durable_next_seq"], 7);
  clock.run_for(100ms);
  listen();
  ASSERT_EQ(told.size(), fleet.size() + 1);
  EXPECT_EQ(told.back()["robot_id"], fleet.front().id);
  EXPECT_EQ(told.back()["durable_next_seq"], 7);
}

// The states of a fleet leave a slow page something else to read.
TEST(Subscriber, StatesAndTheRestTakeTurns) {
  boost::asio::io_context loop;
  Subscriber listener{loop};
  for (int i = 0; i < 100; ++i) listener.push_state(std::to_string(i), message("state"));
  for (int i = 0; i < 3; ++i) listener.push(message("samples"), true);
  std::vector<std::string> first;
  for (int i = 0; i < 6; ++i) first.push_back(*listener.pop());
  EXPECT_EQ(std::ranges::count(first, "samples"), 3);
  EXPECT_EQ(first.front(), "state");
}

TEST(Subscriber, HoldsAtMostAMegabyte) {
  boost::asio::io_context loop;
  Subscriber listener{loop};
  for (int i = 0; i < 20; ++i) listener.push(message(std::string(100'000, 'x')), i % 2 == 0);
  EXPECT_EQ(listener.size(), 10U);
}

TEST(Subscriber, DropsWhatIsOldestWhenThereAreNoSamples) {
  boost::asio::io_context loop;
  Subscriber listener{loop};
  for (std::size_t i = 0; i <= Subscriber::kMaxMessages; ++i) listener.push(message(std::to_string(i)), false);
  EXPECT_EQ(*listener.pop(), R"({"count":1,"type":"dropped"})");
  EXPECT_EQ(*listener.pop(), "1");
}

}  // namespace
}  // namespace server
