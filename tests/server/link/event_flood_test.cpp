// A robot that sends far too many events: a bounded number of them is recorded, the last of each kind among them, and
// of the others their exact count.
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
  EventFloodTest() {
    station.add_sink(left_out);
    tasks.spawn("control", station.watch_control());
  }

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
  // The newest of a kind that was recorded, by its number; none: none was.
  std::optional<std::uint64_t> last_recorded(const std::string& kind) const {
    std::optional<std::uint64_t> last;
    for (const station::RobotEvent& one : sink.events) {
      if (one.kind == kind) last = std::max(last, one.event_seq);
    }
    return last;
  }
  // Each number that was sent is recorded or left out, and none is both.
  void expect_every_number_once() const {
    std::vector<std::uint64_t> numbers = left_out.events;
    for (const station::RobotEvent& one : sink.events) {
      if (one.event_seq) numbers.push_back(*one.event_seq);
    }
    std::ranges::sort(numbers);
    ASSERT_EQ(numbers.size(), next_event_seq_);
    for (std::uint64_t seq = 0; seq < next_event_seq_; ++seq) ASSERT_EQ(numbers[seq], seq);
  }

  LeftOutSink left_out;
  std::uint64_t next_event_seq_ = 0;
};

TEST_F(EventFloodTest, OfFortyThousandInTwoSecondsABoundedNumberIsRecordedAndTheRestIsCounted) {
  auto* robot = connect();
  flood(*robot, 40'000, 2s);
  clock.run_for(200ms);
  const std::size_t kept = recorded("setpoint_changed");
  EXPECT_EQ(kept + left_out.events.size(), 40'000u);
  EXPECT_GE(kept, static_cast<std::size_t>(Allowance::kBurst));
  EXPECT_LE(kept, static_cast<std::size_t>(Allowance::kBurst + 2 * Allowance::kASecond + 2));
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

TEST_F(EventFloodTest, TheCountIsReportedOnceInTenSecondsHoweverOftenTheRobotReconnects) {
  for (int connection = 0; connection < 20; ++connection) {
    auto* robot = connect();
    flood(*robot, 4'000, 100ms);
    robot->link.cut();
    ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 5s));
  }
  EXPECT_EQ(recorded("events_left_out"), 0u);
  clock.run_for(11s);
  ASSERT_EQ(recorded("events_left_out"), 1u);
  const auto said = std::ranges::find(sink.events, "events_left_out", &station::RobotEvent::kind);
  EXPECT_TRUE(said->detail.starts_with(fmt::format("{} from ", left_out.events.size()))) << said->detail;
  expect_every_number_once();
}

TEST_F(EventFloodTest, AtTheEndOfTheStationNothingWaits) {
  auto* robot = connect();
  flood(*robot, 4'000, 1s);
  robot->send(event(rheonaut_EVENT_KIND_MODE_CHANGED, next_event_seq_++));
  clock.settle();
  tasks.stop();
  clock.settle();
  EXPECT_EQ(last_recorded("mode_changed"), next_event_seq_ - 1);
  EXPECT_EQ(recorded("events_left_out"), 1u);
  expect_every_number_once();
}

TEST_F(EventFloodTest, TheRecordEndsWithTheLatchThatIsInForce) {
  auto* robot = connect();
  for (int press = 0; press < 4'000; ++press) {
    robot->send(event(rheonaut_EVENT_KIND_EMERGENCY, next_event_seq_++));
    robot->send(event(rheonaut_EVENT_KIND_EMERGENCY_CLEARED, next_event_seq_++));
    clock.run_for(100us);
  }
  clock.run_for(1s);
  EXPECT_EQ(last_recorded("emergency_cleared"), next_event_seq_ - 1);
  EXPECT_EQ(last_recorded("emergency"), next_event_seq_ - 2);
  EXPECT_LE(recorded("emergency") + recorded("emergency_cleared"),
            static_cast<std::size_t>(Allowance::kBurst + 2 * Allowance::kASecond));
  expect_every_number_once();
}

TEST_F(EventFloodTest, TheLastOfAKindIsRecordedWhateverKindFloodsAfterIt) {
  auto* robot = connect();
  flood(*robot, 4'000, 1s, rheonaut_EVENT_KIND_SENSOR_FAULT);
  const std::uint64_t latched = next_event_seq_;
  robot->send(event(rheonaut_EVENT_KIND_EMERGENCY, next_event_seq_++));
  robot->send(event(rheonaut_EVENT_KIND_LEASE_LAPSED, next_event_seq_++));
  flood(*robot, 4'000, 1s, rheonaut_EVENT_KIND_SENSOR_FAULT);
  EXPECT_EQ(last_recorded("emergency"), latched) << "while the others go on";
  EXPECT_EQ(last_recorded("lease_lapsed"), latched + 1);
  clock.run_for(1s);
  EXPECT_EQ(last_recorded("sensor_fault"), next_event_seq_ - 1);
  expect_every_number_once();
}

TEST_F(EventFloodTest, TheLastIsRecordedAlsoWhenTheLinkIsLostOrTheRobotBootsRightAfterIt) {
  for (const bool boots : {false, true}) {
    SCOPED_TRACE(boots);
    auto* robot = connect();
    flood(*robot, 4'000, 1s, rheonaut_EVENT_KIND_EMERGENCY);
    robot->send(event(rheonaut_EVENT_KIND_LEASE_LAPSED, next_event_seq_++));
    robot->send(event(rheonaut_EVENT_KIND_EMERGENCY_CLEARED, next_event_seq_++));
    clock.settle();
    const std::uint64_t last = next_event_seq_ - 1;
    EXPECT_NE(last_recorded("emergency_cleared"), last) << "or this is no test";
    robot->link.cut();
    if (boots) {
      auto* rebooted = dial();
      protocol::RobotFrame hello = TestRobot::hello_frame();
      hello.body.hello.boot_id = 78;
      clock.settle();
      rebooted->send(hello);
      clock.settle();
      EXPECT_EQ(last_recorded("emergency_cleared"), last) << "at once, since its boot has ended";
      EXPECT_EQ(sink.events.back().boot_id, 78u);
    }
    clock.run_for(1s);
    EXPECT_EQ(last_recorded("emergency_cleared"), last);
  }
}

TEST_F(EventFloodTest, AStopIsRecordedInAFloodOfOtherEvents) {
  auto* robot = connect();
  flood(*robot, 4'000, 1s);
  robot->send(event(rheonaut_EVENT_KIND_EMERGENCY, next_event_seq_++));
  clock.settle();
  EXPECT_EQ(recorded("emergency"), 1u);
  flood(*robot, 4'000, 1s, rheonaut_EVENT_KIND_EMERGENCY);
  EXPECT_LE(recorded("emergency"), static_cast<std::size_t>(Allowance::kBurst + Allowance::kASecond + 2))
      << "these are bounded, too";
}

TEST_F(EventFloodTest, WhatComesAgainIsNotCountedTwice) {
  auto* robot = connect();
  flood(*robot, 4'000, 1s);
  clock.run_for(200ms);
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
