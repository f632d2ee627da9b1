// A value that cannot be takes no robot off the air: it would send it again, and be taken off again.
#include <limits>

#include "server/live/state_json.hpp"
#include "server/station/state/frame_faults.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::uint64_t kFar = std::uint64_t{1} << 63;

struct UnusableSink final : station::StationSink {
  void on_unusable_samples(const station::RobotState&, std::uint64_t first_seq, std::uint64_t next_seq) override {
    samples.emplace_back(first_seq, next_seq);
  }
  void on_unusable_event(const station::RobotState&, std::uint64_t event_seq) override { events.push_back(event_seq); }
  std::vector<std::pair<std::uint64_t, std::uint64_t>> samples;
  std::vector<std::uint64_t> events;
};

class InvalidValuesTest : public LinkTest {
 protected:
  InvalidValuesTest() { station.add_sink(unusable); }

  static protocol::RobotFrame samples(std::uint64_t first_seq, auto change) {
    protocol::RobotFrame frame = TestRobot::samples_frame(first_seq, 5, 6'000'000, 0);
    change(frame);
    return frame;
  }
  static protocol::RobotFrame event(auto change) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event.event_seq = 7;
    change(frame.body.event);
    return frame;
  }
  std::vector<station::RobotEvent> events() const {
    std::vector<station::RobotEvent> found;
    for (const station::RobotEvent& event : sink.events) {
      if (event.kind == "invalid_value") found.push_back(event);
    }
    return found;
  }

  UnusableSink unusable;
};

TEST_F(InvalidValuesTest, WhatIsNoFiniteNumberIsNothingAndTheSamplesAreKept) {
  auto* robot = connect();
  robot->send(samples(0, [](auto& frame) { frame.body.telemetry.disturbance_m = kNotANumber; }));
  robot->send(samples(5, [](auto& frame) { frame.body.telemetry.position_sd_m = -kInfinity; }));
  robot->send(samples(10, [](auto& frame) {
    frame.body.telemetry.has_setpoint_m = true;
    frame.body.telemetry.setpoint_m = kNotANumber;
  }));
  clock.run_for(2s);
  EXPECT_FALSE(robot->closed);
  ASSERT_EQ(sink.batches.size(), 3u);
  EXPECT_EQ(sink.batches[0].context.disturbance_m, std::nullopt);
  EXPECT_EQ(sink.batches[0].context.position_sd_m, 0.0F);
  EXPECT_EQ(sink.batches[1].context.position_sd_m, std::nullopt);
  EXPECT_EQ(sink.batches[2].context.setpoint_m, std::nullopt);
  EXPECT_EQ(nlohmann::json::parse(live::samples_message(sink.batches[1]))["position_sd_m"], nullptr);
  EXPECT_EQ(sink.batches[0].context, sink.batches[0].context) << "or each batch would begin a new segment";
  EXPECT_TRUE(unusable.samples.empty());
}

TEST_F(InvalidValuesTest, TheyAreCountedAndReportedOnceInTenSeconds) {
  auto* robot = connect();
  const auto send_broken = [&](std::uint64_t first_seq) {
    robot->send(samples(first_seq, [](auto& frame) {
      frame.body.telemetry.disturbance_m = kNotANumber;
      frame.body.telemetry.position_sd_m = kNotANumber;
    }));
    clock.settle();
  };
  for (std::uint64_t i = 0; i < 20; ++i) send_broken(5 * i);
  ASSERT_EQ(events().size(), 1u);
  EXPECT_EQ(events()[0].cause, "not_finite");
  EXPECT_EQ(events()[0].detail, "disturbance_m is nan from sample 0 on; NULL is stored (1 more since the last event)");
  EXPECT_EQ(station.find("r1")->invalid_values, 40u);
  EXPECT_EQ(station.invalid_values(), 40u);
  EXPECT_EQ(live::to_json(*station.find("r1"))["invalid_values"], 40);
  clock.run_for(10s);
  send_broken(100);
  ASSERT_EQ(events().size(), 2u);
  EXPECT_TRUE(events()[1].detail.ends_with("(39 more since the last event)")) << events()[1].detail;
}

TEST_F(InvalidValuesTest, SamplesWithoutATimeAreLostAndTheLinkGoesOn) {
  auto* robot = connect();
  robot->send(samples(0, [](auto& frame) { frame.body.telemetry.period_us = 0; }));
  robot->send(samples(5, [](auto& frame) { frame.body.telemetry.period_us = 10'000'001; }));
  robot->send(samples(10, [](auto& frame) { frame.body.telemetry.first_robot_time_us = kFar; }));
  robot->send(samples(kFar, [](auto&) {}));  // nobody can say which these are
  robot->send(samples(15, [](auto& frame) { frame.body.telemetry.oldest_seq = kFar; }));
  clock.run_for(2s);
  EXPECT_FALSE(robot->closed);
  EXPECT_EQ(unusable.samples, (std::vector<std::pair<std::uint64_t, std::uint64_t>>{{0, 5}, {5, 10}, {10, 15}}));
  ASSERT_EQ(sink.batches.size(), 1u);
  EXPECT_EQ(sink.batches[0].first_seq, 15u);
  EXPECT_EQ(sink.batches[0].oldest_seq, 0u);
  EXPECT_EQ(station.find("r1")->invalid_values, 5u);
}

TEST_F(InvalidValuesTest, AnEventWithoutATimeIsLostAndTheLinkGoesOn) {
  auto* robot = connect();
  const std::size_t before = sink.events.size();
  robot->send(event([](auto& of) { of.event_robot_time_us = kFar; }));
  robot->send(event([](auto& of) { of.sample_seq = kFar; }));
  robot->send(event([](auto& of) { of.event_seq = kFar; }));
  robot->send(event([](auto& of) { of.oldest_event_seq = kFar; }));
  clock.run_for(2s);
  EXPECT_FALSE(robot->closed);
  EXPECT_EQ(unusable.events, (std::vector<std::uint64_t>{7, 7}));
  ASSERT_EQ(sink.events.size(), before + 2) << "invalid_value, and the one whose own values can be";
  EXPECT_EQ(sink.events.back().event_seq, 7u);
  EXPECT_EQ(sink.events.back().oldest_event_seq, 0u);
}

TEST_F(InvalidValuesTest, ATimeOfAFrameThatCannotBeIsASignOfLifeAndMovesNoClock) {
  auto* robot = connect();
  const std::uint64_t before_us = station.find("r1")->latest_robot_time_us;
  robot->send(samples(0, [](auto& frame) { frame.robot_time_us = kFar; }));
  clock.settle();
  EXPECT_FALSE(robot->closed);
  EXPECT_EQ(station.find("r1")->latest_robot_time_us, before_us);
  EXPECT_EQ(sink.batches.size(), 1u);
}

TEST_F(InvalidValuesTest, ANumberFarBeyondAllBeforeItMakesNoTrueOneOld) {
  auto* robot = connect();
  constexpr std::uint64_t kLeap = std::uint64_t{1} << 40;
  robot->send(samples(kLeap, [](auto&) {}));
  robot->send(samples(0, [](auto& frame) { frame.body.telemetry.oldest_seq = kLeap; }));
  robot->send(event([](auto& of) { of.event_seq = kLeap; }));
  robot->send(event([](auto& of) { of.oldest_event_seq = kLeap; }));
  robot->send(samples(5, [](auto& frame) { frame.robot_time_us = kLeap; }));
  clock.settle();
  EXPECT_EQ(station.find("r1")->invalid_values, 5u);
  ASSERT_EQ(sink.batches.size(), 2u);
  EXPECT_EQ(sink.batches[0].oldest_seq, 0u);
  EXPECT_EQ(sink.events.back().oldest_event_seq, 0u);
  EXPECT_TRUE(unusable.events.empty()) << "nobody can say which it was";
  EXPECT_LT(station.find("r1")->latest_robot_time_us, kLeap);
  robot->send(samples(10, [](auto& frame) { frame.body.telemetry.emergency_id = 7; }));
  clock.settle();
  EXPECT_TRUE(station.find("r1")->latched()) << "what is true is live";
}

TEST_F(InvalidValuesTest, ANumberThatLeapsWithoutItsTimeKeepsNoTrueOneOut) {
  auto* robot = connect();
  robot->send(samples(0, [](auto&) {}));
  robot->send(samples(500'000, [](auto&) {}));  // a boot that was stored so far could not connect again for 83 min
  robot->send(samples(5, [](auto&) {}));
  clock.settle();
  EXPECT_FALSE(robot->closed);
  ASSERT_EQ(sink.batches.size(), 2u);
  EXPECT_EQ(sink.batches[1].first_seq, 5u);
  EXPECT_EQ(station.find("r1")->next_seq, 10u) << "the true ones are live";
  EXPECT_EQ(station.find("r1")->invalid_values, 1u);
  EXPECT_TRUE(unusable.samples.empty()) << "none is counted as lost: nobody can say which these are";
}

TEST_F(InvalidValuesTest, SamplesThatNeverHaveATimeAreLostForGoodHoweverManyTheyAre) {
  auto* robot = connect();
  constexpr std::uint64_t kMany = 2 * station::FrameReach::kSeqSlack;
  for (std::uint64_t seq = 0; seq < kMany; seq += 5) {
    robot->send(samples(seq, [](auto& frame) { frame.body.telemetry.first_robot_time_us = kFar; }));
    clock.settle();
  }
  ASSERT_EQ(unusable.samples.size(), kMany / 5);
  EXPECT_EQ(unusable.samples.back(), (std::pair{kMany - 5, kMany}));
}

TEST_F(InvalidValuesTest, OfARobotWhoseFramesDoNotDecodeAStopIsRepeatedAndCommandsEnd) {
  auto* robot = dial();
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  submit(set_duty(0.3F), 500ms);
  clock.settle();
  stop_robot();
  for (int i = 0; i < 60; ++i) {
    robot->send_bytes({2, 0xff, 0xff});
    clock.run_for(50ms);
  }
  EXPECT_TRUE(connected());
  EXPECT_GE(robot->commands().size(), 4u) << "the duty, and a stop each second";
  ASSERT_FALSE(results.empty());
  EXPECT_TRUE(
      std::ranges::any_of(results, [](const auto& one) { return one->state == station::CommandState::unknown; }));
}

class FrameFaultsTest : public ::testing::Test {
 protected:
  static protocol::RobotFrame samples(std::uint64_t first_seq, std::uint64_t oldest_seq, std::uint64_t time_us) {
    protocol::RobotFrame frame = TestRobot::samples_frame(first_seq, 5, time_us, 0);
    frame.body.telemetry.first_robot_time_us = time_us;
    frame.body.telemetry.oldest_seq = oldest_seq;
    return frame;
  }
  // Of a robot whose numbers are as large as they can be, whatever it has sent since its hello.
  static station::FrameReach at_the_end() {
    protocol::Hello hello = rheonaut_Hello_init_zero;
    hello.next_seq = hello.next_event_seq = station::kMaxRobotNumber;
    station::FrameReach reach = station::FrameReach::after(hello, station::kMaxRobotNumber);
    reach.advance(samples(station::kMaxRobotNumber, 0, station::kMaxRobotNumber));
    return reach;
  }
};

TEST_F(FrameFaultsTest, WhatCanBeUsedIsCheckedAndNothingElse) {
  protocol::RobotFrame frame = samples(10, 5, 6'000'000);
  const station::FrameFaults none = station::mend(frame, {});
  ASSERT_TRUE(none.samples);
  EXPECT_EQ(&**none.samples, &frame.body.telemetry);
  EXPECT_FALSE(none.event);
  for (const std::uint32_t period_us : {0U, station::kMaxPeriodUs + 1}) {
    frame.body.telemetry.period_us = period_us;
    const station::FrameFaults faults = station::mend(frame, {});
    EXPECT_TRUE(faults.is_unusable);
    EXPECT_FALSE(faults.samples) << period_us;
  }
  frame.which_body = rheonaut_RobotFrame_event_tag;
  frame.body.event = rheonaut_Event_init_zero;
  EXPECT_TRUE(station::mend(frame, {}).event);
  EXPECT_FALSE(station::mend(frame, {}).samples);
  frame.body.event.sample_seq = kFar;
  EXPECT_FALSE(station::mend(frame, {}).event);
}

TEST_F(FrameFaultsTest, NoNumberIsBeyondWhatCanBeStoredHoweverFarTheRobotHasCome) {
  const station::FrameReach reach = at_the_end();
  protocol::RobotFrame last = samples(station::kMaxRobotNumber, station::kMaxRobotNumber, station::kMaxRobotNumber);
  EXPECT_TRUE(station::mend(last, reach).samples);
  protocol::RobotFrame late = samples(0, 0, station::kMaxRobotNumber + 1);
  EXPECT_FALSE(station::mend(late, reach).samples);
  protocol::RobotFrame beyond = samples(station::kMaxRobotNumber + 1, 0, 6'000'000);
  EXPECT_FALSE(station::mend(beyond, reach).samples);
  protocol::RobotFrame event = rheonaut_RobotFrame_init_zero;
  event.which_body = rheonaut_RobotFrame_event_tag;
  event.body.event.event_seq = station::kMaxRobotNumber;
  EXPECT_TRUE(station::mend(event, reach).event);
  event.body.event.event_seq = station::kMaxRobotNumber + 1;
  EXPECT_FALSE(station::mend(event, reach).event);
}

// 100 samples were made before the hello, which said 10 s.
TEST_F(FrameFaultsTest, ANumberIsNotFurtherThanItsTimeAllows) {
  constexpr std::uint64_t kSlack = station::FrameReach::kSeqSlack;
  constexpr std::uint64_t kSecondUs = 1'000'000, kHelloUs = 10 * kSecondUs;
  protocol::Hello hello = rheonaut_Hello_init_zero;
  hello.next_seq = 100;
  station::FrameReach reach = station::FrameReach::after(hello, kHelloUs);
  const auto is_taken = [&reach](std::uint64_t first_seq, std::uint64_t time_us) {
    protocol::RobotFrame frame = samples(first_seq, 0, time_us);
    const station::FrameFaults faults = station::mend(frame, reach);
    EXPECT_EQ(faults.has_number, faults.samples.has_value());
    return faults.samples.has_value();
  };
  EXPECT_TRUE(is_taken(0, kSecondUs)) << "from the ring";
  EXPECT_TRUE(is_taken(100 + kSlack, kHelloUs));
  EXPECT_FALSE(is_taken(101 + kSlack, kHelloUs));
  EXPECT_FALSE(is_taken(101 + kSlack, kSecondUs));
  EXPECT_TRUE(is_taken(100 + 360'000, kHelloUs + 3'600 * kSecondUs)) << "an outage of an hour";
  EXPECT_FALSE(is_taken(101 + 360'000 + kSlack, kHelloUs + 3'600 * kSecondUs));
  reach.advance(samples(3'000, 0, kHelloUs + 29 * kSecondUs));
  EXPECT_TRUE(is_taken(3'005 + kSlack, kHelloUs + 29 * kSecondUs));
  EXPECT_FALSE(is_taken(3'006 + kSlack, kHelloUs + 29 * kSecondUs)) << "it counts from the latest";
  EXPECT_TRUE(is_taken(3'005 + kSlack + 100, kHelloUs + 30 * kSecondUs));
}

TEST_F(FrameFaultsTest, TheOldestThatARobotHoldsIsNotAboveWhatItSends) {
  protocol::RobotFrame frame = samples(10, 11, 6'000'000);
  const station::FrameFaults faults = station::mend(frame, {});
  EXPECT_EQ(faults.count, 1u);
  ASSERT_TRUE(faults.samples);
  EXPECT_EQ((**faults.samples).oldest_seq, 0u);
}

TEST_F(FrameFaultsTest, AHeartbeatWithATimeThatCannotBeAnswersNothing) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
  frame.body.heartbeat.echo_station_time_us = 5;
  frame.body.heartbeat.echo_received_at_robot_us = kFar;
  EXPECT_EQ(station::mend(frame, {}).count, 1u);
  EXPECT_EQ(frame.body.heartbeat.echo_station_time_us, 0u);
  frame.body.heartbeat.echo_station_time_us = 5;
  EXPECT_EQ(station::mend(frame, {}).count, 0u);
  EXPECT_EQ(frame.body.heartbeat.echo_station_time_us, 5u);
}

}  // namespace
}  // namespace server
