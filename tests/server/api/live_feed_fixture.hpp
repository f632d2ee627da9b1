// The feed of live messages with one subscriber, in virtual time.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/live/live_feed.hpp"
#include "server/runtime/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {

using namespace std::chrono_literals;
using nlohmann::json;

class LiveFeedFixture : public ::testing::Test {
 public:
  LiveFeedFixture() {
    robot.id = "r1";
    robot.link = station::LinkState::connected;
    robot.boot_id = 0xfedcba9876543210;
    robot.context.mode = rheonaut_MODE_MANUAL;
    robot.context.period_us = 25'000;
    live.add(listener);
    tasks.spawn("live feed", live.run());
  }
  ~LiveFeedFixture() override {
    tasks.stop();
    clock.settle();
  }

 protected:
  std::vector<json> received() {
    std::vector<json> all;
    for (live::LiveText text = listener.pop(); text != nullptr; text = listener.pop())
      all.push_back(json::parse(*text));
    return all;
  }
  std::vector<std::string> types() {
    std::vector<std::string> all;
    for (const json& one : received()) all.push_back(one["type"]);
    return all;
  }
  station::SampleBatch batch(std::uint64_t first_seq) const {
    station::SampleBatch made;
    made.robot_id = robot.id;
    made.boot_id = robot.boot_id;
    made.first_seq = first_seq;
    made.context = robot.context;
    made.samples = {{.position_m = 0.1F, .duty = -0.5F}, {.position_m = 0.2F, .impedance_mv = 175}};
    return made;
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  live::LiveFeed live{clock};
  live::Subscriber listener{loop};
  station::RobotState robot;
};

using Types = std::vector<std::string>;

}  // namespace server
