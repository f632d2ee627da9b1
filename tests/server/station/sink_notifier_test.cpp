// What reaches the sinks, in which order, and what an event of the station itself says.
#include "server/station/sink_notifier.hpp"

#include <gmock/gmock.h>

#include <stdexcept>

#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Notes the name of each call behind its own name; throws when it is told to.
class NamingSink final : public station::StationSink {
 public:
  NamingSink(std::string name, std::vector<std::string>& calls) : name_{std::move(name)}, calls_{calls} {}

  void on_robot(const station::RobotState&) override { note("robot"); }
  void on_fluid(const station::RobotState&) override { note("fluid"); }
  void on_samples(const station::RobotState&, const station::SampleBatch&) override { note("samples"); }
  void on_unusable_samples(const station::RobotState&, std::uint64_t first_seq, std::uint64_t next_seq) override {
    note("unusable samples " + std::to_string(first_seq) + " to " + std::to_string(next_seq));
  }
  void on_unusable_event(const station::RobotState&, std::uint64_t event_seq) override {
    note("unusable event " + std::to_string(event_seq));
  }
  void on_event(const station::RobotState&, const station::RobotEvent& event) override {
    note("event");
    latest = event;
  }
  void on_command(const station::CommandRecord&) override { note("command"); }
  void on_audit(const station::AuditNote&) override { note("audit"); }
  void on_clock(const station::RobotState&, const station::ClockRecord&) override { note("clock"); }
  void on_in_force(const station::RobotState&, const station::InForceRecord&) override { note("in force"); }

  bool is_broken = false;
  station::RobotEvent latest;

 private:
  void note(const std::string& call) {
    if (is_broken) throw std::runtime_error{"no room for it"};
    calls_.push_back(name_ + ": " + call);
  }

  const std::string name_;
  std::vector<std::string>& calls_;
};

class SinkNotifierTest : public ::testing::Test {
 protected:
  SinkNotifierTest() {
    notifier.add(first);
    robot.id = "r1";
    robot.boot_id = 7;
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  station::SinkNotifier notifier{clock};
  std::vector<std::string> calls;
  NamingSink first{"first", calls}, second{"second", calls};
  station::RobotState robot;
};

TEST_F(SinkNotifierTest, EachKindReachesItsOwnFunction) {
  notifier.publish(robot);
  notifier.publish(station::CommandRecord{});
  notifier.publish(station::AuditNote{});
  notifier.publish(robot, station::SampleBatch{});
  notifier.publish(robot, station::RobotEvent{});
  notifier.publish(robot, station::ClockRecord{});
  notifier.publish(robot, station::InForceRecord{});
  notifier.publish_fluid(robot);
  notifier.publish_unusable_samples(robot, 5, 10);
  notifier.publish_unusable_event(robot, 3);
  EXPECT_THAT(calls, ElementsAre("first: robot", "first: command", "first: audit", "first: samples", "first: event",
                                 "first: clock", "first: in force", "first: fluid", "first: unusable samples 5 to 10",
                                 "first: unusable event 3"));
}

TEST_F(SinkNotifierTest, SinksAreCalledInTheOrderInWhichTheyWereAdded) {
  notifier.add(second);
  notifier.publish(robot);
  EXPECT_THAT(calls, ElementsAre("first: robot", "second: robot"));
}

TEST_F(SinkNotifierTest, WhatASinkThrowsReachesTheCallerBeforeTheNextSink) {
  notifier.add(second);
  first.is_broken = true;
  EXPECT_THROW(notifier.publish(robot), std::runtime_error);
  EXPECT_THAT(calls, IsEmpty());
}

TEST_F(SinkNotifierTest, AnEventOfTheStationCarriesTheRobotsStateAndTheTime) {
  robot.context.mode = rheonaut_MODE_AUTO;
  robot.context.sub_state = rheonaut_SUB_STATE_NONE;
  robot.context.emergency_id = 99;
  robot.context.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
  robot.latest_robot_time_us = 1'000'000;
  notifier.note(robot, "connected", "from memory", "timeout");
  const station::RobotEvent& event = first.latest;
  EXPECT_EQ(event.robot_id, "r1");
  EXPECT_EQ(event.boot_id, 7U);
  EXPECT_FALSE(event.event_seq.has_value()) << "the robot has not numbered it";
  EXPECT_EQ(event.kind, "connected");
  EXPECT_EQ(event.detail, "from memory");
  EXPECT_EQ(event.cause, "timeout");
  EXPECT_EQ(event.mode, rheonaut_MODE_AUTO);
  EXPECT_EQ(event.emergency_id, 99U);
  EXPECT_EQ(event.emergency_cause, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  EXPECT_EQ(event.robot_time_us, 1'000'000U);
  EXPECT_EQ(event.received_at_us, clock.utc_us());
}

}  // namespace
}  // namespace server
