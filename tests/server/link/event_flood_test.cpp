// A robot that sends far too many events: a bounded number of them is recorded, and of the others their exact count.
#include <fmt/format.h>

#include "server/live/state_json.hpp"
#include "server/station/state/event_allowance.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

using Allowance = station::EventAllowance;

struct LeftOutSink final : station::StationSink {
  void on_event_left_out(const station::RobotState&, std::uint64_t event_seq) override { events.push_back(event_seq); }
  std::vector<std::uint64_t> events;
};

class EventFloodTest : public LinkTest {
 protected:
  EventFloodTest() { station.add_sink(left_out); }

  static protocol::RobotFrame event(protocol::EventKind kind, std::uint64_t event_seq) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event.kind = kind;
    frame.body.event.event_seq = event_seq;
    return frame;
  }
  void flood(TestRobot& robot, int count, microseconds duration,
             protocol::EventKind kind = rheonaut_EVENT_KIND_SETPOINT_CHANGED) {
    constexpr int kPieces = 100;
    for (int piece = 0; piece < kPieces; ++piece) {
      for (int n = 0; n < count / kPieces; ++n) robot.send(event(kind, next_event_seq_++));
      clock.run_for(duration / kPieces);
    }
  }
  std::size_t recorded(const std::string& kind) const {
    return static_cast<std::size_t>(std::ranges::count(sink.events, kind, &station::RobotEvent::kind));
  }

  LeftOutSink left_out;
  std::uint64_t next_event_seq_ = 0;
};

TEST_F(EventFloodTest, OfFortyThousandInTwoSecondsABoundedNumberIsRecordedAndTheRestIsCounted) {
  auto* robot = connect();
  flood(*robot, 40'000, 2s);
  const std::size_t kept = recorded("setpoint_changed");
  EXPECT_EQ(kept + left_out.events.size(), 40'000u);
  EXPECT_GE(kept, static_cast<std::size_t>(Allowance::kBurst));
  EXPECT_LE(kept, static_cast<std::size_t>(Allowance::kBurst + 2 * Allowance::kASecond + 1));
  EXPECT_EQ(station.find("r1")->events_left_out, left_out.events.size());
  EXPECT_EQ(station.events_left_out(), left_out.events.size());
  EXPECT_EQ(live::to_json(*station.find("r1"))["events_left_out"], left_out.events.size());
  EXPECT_FALSE(robot->closed);
}

TEST_F(EventFloodTest, AnEventSaysHowManyWereLeftOutAndWhen) {
  auto* robot = connect();
  flood(*robot, 40'000, 2s);
  EXPECT_EQ(recorded("events_left_out"), 0u);
  clock.run_for(10s);
  ASSERT_EQ(recorded("events_left_out"), 1u);
  const auto said = std::ranges::find(sink.events, "events_left_out", &station::RobotEvent::kind);
  EXPECT_EQ(said->cause, "too_many");
  EXPECT_TRUE(said->detail.starts_with(fmt::format("{} from ", left_out.events.size()))) << said->detail;
  clock.run_for(60s);
  EXPECT_EQ(recorded("events_left_out"), 1u) << "there were no others";
}

TEST_F(EventFloodTest, ADisconnectReportsTheRestAtOnce) {
  auto* robot = connect();
  flood(*robot, 4'000, 1s);
  robot->link.cut();
  ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 5s));
  const auto said = std::ranges::find(sink.events, "events_left_out", &station::RobotEvent::kind);
  ASSERT_NE(said, sink.events.end());
  EXPECT_TRUE(said->detail.starts_with(fmt::format("{} from ", left_out.events.size()))) << said->detail;
}

TEST_F(EventFloodTest, AStopIsRecordedInAFloodOfOtherEvents) {
  auto* robot = connect();
  flood(*robot, 4'000, 1s);
  robot->send(event(rheonaut_EVENT_KIND_EMERGENCY, next_event_seq_++));
  clock.settle();
  EXPECT_EQ(recorded("emergency"), 1u);
  flood(*robot, 4'000, 1s, rheonaut_EVENT_KIND_EMERGENCY);
  EXPECT_LE(recorded("emergency"), static_cast<std::size_t>(Allowance::kBurst + Allowance::kASecond + 1))
      << "these are bounded, too";
}

TEST_F(EventFloodTest, WhatComesAgainIsNotCountedTwice) {
  auto* robot = connect();
  flood(*robot, 4'000, 1s);
  const std::size_t before = left_out.events.size();
  next_event_seq_ = 0;
  flood(*robot, 4'000, 1s);
  EXPECT_EQ(left_out.events.size(), before);
}

TEST_F(EventFloodTest, ASetpointEach20MsForTenMinutesIsNoFlood) {
  auto* robot = connect();
  for (int second = 0; second < 600; ++second) {
    for (int n = 0; n < 50; ++n) robot->send(event(rheonaut_EVENT_KIND_SETPOINT_CHANGED, next_event_seq_++));
    clock.run_for(1s);
  }
  EXPECT_EQ(station.events_left_out(), 0u);
}

}  // namespace
}  // namespace server
