// Whether a stop would arrive now: what opens and closes its way.
#include "server/link/stop_probes.hpp"

#include <gtest/gtest.h>

#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

constexpr std::int64_t kHeartbeatUs = 200'000, kUtcUs = 1'700'000'000'000'000, kBeginUs = 10'000'000;

// Probes of a robot that sends a frame every 50 ms, unless the test says otherwise.
class StopProbesTest : public ::testing::Test {
 protected:
  StopProbesTest() { probes.begin(kBeginUs); }
  bool is_open(std::int64_t now_us) { return probes.judge(now_us - now_us % 50'000, now_us).is_open; }
  void ask_and_answer(std::int64_t now_us, std::int64_t round_trip_us) {
    ASSERT_TRUE(probes.is_due(now_us));
    const std::uint64_t stamp_us = probes.take(now_us);
    EXPECT_TRUE(probes.on_answer(stamp_us, now_us + round_trip_us, kUtcUs));
  }
  link::StopProbes probes{kHeartbeatUs};
};

TEST_F(StopProbesTest, TheWayIsNotOpenBeforeTheFirstAnswer) {
  EXPECT_FALSE(is_open(kBeginUs));
  probes.take(kBeginUs);
  EXPECT_FALSE(is_open(kBeginUs + 1000));
  EXPECT_TRUE(probes.judge(kBeginUs, kBeginUs).is_measured);
  EXPECT_FALSE(link::StopProbes{kHeartbeatUs}.judge(kBeginUs, kBeginUs).is_measured);
}

TEST_F(StopProbesTest, AnAnswerOpensItWithItsRoundTrip) {
  ask_and_answer(kBeginUs, 12'345);
  EXPECT_TRUE(is_open(kBeginUs + 12'345));
  EXPECT_EQ(probes.judge(kBeginUs, kBeginUs).round_trip_us, 12'345);
  EXPECT_EQ(probes.judge(kBeginUs, kBeginUs).answered_at_us, kUtcUs);
  EXPECT_FALSE(probes.is_due(kBeginUs + 499'000));
}

// SAFETY: never a false "open".
TEST_F(StopProbesTest, AnAnswerThatIsLateClosesItUntilItComes) {
  ask_and_answer(kBeginUs, 10'000);
  const std::int64_t asked_us = kBeginUs + 500'000;
  const std::uint64_t stamp_us = probes.take(asked_us);
  EXPECT_TRUE(is_open(asked_us + 249'000));
  EXPECT_FALSE(is_open(asked_us + 250'000));
  EXPECT_TRUE(probes.on_answer(stamp_us, asked_us + 300'000, kUtcUs));
  EXPECT_TRUE(is_open(asked_us + 300'000));
  EXPECT_EQ(probes.judge(asked_us, asked_us).round_trip_us, 300'000);
}

TEST_F(StopProbesTest, AfterALateAnswerTheNextProbeMakesItNoYounger) {
  ask_and_answer(kBeginUs, 10'000);
  probes.take(kBeginUs + 500'000);
  probes.take(kBeginUs + 1'000'000);
  EXPECT_FALSE(is_open(kBeginUs + 1'001'000)) << "the first was never answered";
}

TEST_F(StopProbesTest, AnAnswerToAnEarlierProbeDoesNotOpenIt) {
  const std::uint64_t first = probes.take(kBeginUs);
  const std::uint64_t second = probes.take(kBeginUs + 500'000);
  EXPECT_FALSE(probes.on_answer(first, kBeginUs + 510'000, kUtcUs));
  EXPECT_FALSE(is_open(kBeginUs + 510'000));
  EXPECT_TRUE(probes.on_answer(second, kBeginUs + 520'000, kUtcUs));
  EXPECT_FALSE(probes.on_answer(second, kBeginUs + 530'000, kUtcUs)) << "once";
  EXPECT_FALSE(probes.on_answer(0, kBeginUs + 530'000, kUtcUs));
}

TEST_F(StopProbesTest, OneThatCannotBeWrittenClosesItAsWell) {
  ask_and_answer(kBeginUs, 10'000);
  EXPECT_TRUE(is_open(kBeginUs + 749'000));
  EXPECT_FALSE(is_open(kBeginUs + 750'000)) << "due at 500 ms";
  probes.take(kBeginUs + 760'000);
  EXPECT_FALSE(is_open(kBeginUs + 761'000));
}

TEST_F(StopProbesTest, ASilentRobotClosesIt) {
  ask_and_answer(kBeginUs, 10'000);
  const std::int64_t heard_us = kBeginUs + 100'000;
  EXPECT_TRUE(probes.judge(heard_us, heard_us + 249'000).is_open);
  EXPECT_FALSE(probes.judge(heard_us, heard_us + 250'000).is_open);
}

TEST_F(StopProbesTest, ItSaysUntilWhenAnOpenWayStaysOpen) {
  ask_and_answer(kBeginUs, 10'000);
  for (const std::int64_t heard_us : {kBeginUs + 100'000, kBeginUs + 700'000}) {
    const std::int64_t ends_us = probes.ends_us(heard_us);
    EXPECT_TRUE(probes.judge(heard_us, ends_us - 1).is_open);
    EXPECT_FALSE(probes.judge(heard_us, ends_us).is_open);
  }
}

// The same over a link in virtual time.
class StopPathTest : public LinkTest {
 protected:
  StopPathTest() {
    auto hello = TestRobot::hello_frame();
    hello.body.hello.answers_stop_probes = true;
    robot = dial();
    robot->send(hello);
    EXPECT_TRUE(clock.run_until([&] { return !probes().empty(); }, 1s));
  }
  std::vector<std::uint64_t> probes() const {
    std::vector<std::uint64_t> stamps;
    for (const auto& frame : robot->frames) {
      if (frame.which_body == rheonaut_StationFrame_stop_probe_tag)
        stamps.push_back(frame.body.stop_probe.station_time_us);
    }
    return stamps;
  }
  void answer() {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_stop_probe_answer_tag;
    frame.body.stop_probe_answer.echo_station_time_us = probes().back();
    robot->send(frame);
    clock.settle();
  }
  // For so long the robot answers probes and sends a frame each 50 ms.
  void run_well(std::chrono::milliseconds length) {
    for (std::chrono::milliseconds passed{0}; passed < length; passed += 50ms) {
      clock.run_for(50ms);
      robot->send_samples(seq_, 5, robot->robot_now_us() - 50'000, 0);
      seq_ += 5;
      if (probes().size() > answered_) {
        answered_ = probes().size();
        answer();
      }
      clock.settle();
    }
  }
  const station::StopPath& path() const { return station.find("r1")->stop_path; }
  std::size_t states_published(bool open) const {
    return static_cast<std::size_t>(std::ranges::count_if(
        sink.robots, [open](const station::RobotState& state) { return state.stop_path.is_open == open; }));
  }

  TestRobot* robot;

 private:
  std::uint64_t seq_ = 0;
  std::size_t answered_ = 0;
};

TEST_F(StopPathTest, IsMeasuredTwiceASecondAndPublishedWhenItOpens) {
  EXPECT_TRUE(path().is_measured);
  EXPECT_FALSE(path().is_open);
  EXPECT_EQ(states_published(true), 0U);
  clock.run_for(8ms);
  answer();
  EXPECT_TRUE(path().is_open);
  EXPECT_EQ(path().round_trip_us, 8000);
  EXPECT_EQ(states_published(true), 1U);
  run_well(10s);
  EXPECT_TRUE(path().is_open);
  EXPECT_NEAR(static_cast<double>(probes().size()), 21, 1);
}

// SAFETY: within 300 ms of the last frame, whether the robot is gone or only its answers.
TEST_F(StopPathTest, ClosesWithin300MsOfARobotThatFallsSilentAndOpensAgain) {
  run_well(2s);
  ASSERT_TRUE(path().is_open);
  const auto before = states_published(false);
  EXPECT_TRUE(clock.run_until([&] { return !path().is_open; }, 260ms));
  EXPECT_EQ(states_published(false), before + 1) << "published at once";
  EXPECT_TRUE(connected()) << "the link is not lost yet";
  run_well(600ms);
  EXPECT_TRUE(path().is_open);
}

TEST_F(StopPathTest, ClosesWhenProbesStayUnansweredThoughSamplesCome) {
  run_well(2s);
  ASSERT_TRUE(path().is_open);
  const std::size_t asked = probes().size();
  std::uint64_t seq = 100'000;
  const bool has_closed = [&] {
    for (int i = 0; i < 16; ++i, seq += 5) {  // 800 ms
      clock.run_for(50ms);
      robot->send_samples(seq, 5, robot->robot_now_us() - 50'000, 0);
      clock.settle();
      if (!path().is_open) return true;
    }
    return false;
  }();
  EXPECT_TRUE(has_closed);
  EXPECT_EQ(probes().size(), asked + 1);
}

TEST_F(StopPathTest, ClosesWithTheConnection) {
  run_well(1s);
  ASSERT_TRUE(path().is_open);
  robot->link.cut();
  clock.settle();
  EXPECT_FALSE(path().is_open);
  EXPECT_EQ(path().round_trip_us, 0);
  EXPECT_TRUE(path().is_measured);
}

TEST_F(StopPathTest, AProbeIsNoCommand) {
  run_well(5s);
  EXPECT_TRUE(sink.commands.empty());
  EXPECT_TRUE(robot->commands().empty());
  EXPECT_TRUE(std::ranges::none_of(sink.events, [](const auto& event) { return event.kind != "connected"; }));
}

TEST_F(LinkTest, ARobotOfAnEarlierFirmwareGetsNoStopProbe) {
  auto* robot = connect();
  clock.run_for(3s);
  EXPECT_TRUE(connected());
  EXPECT_TRUE(std::ranges::none_of(
      robot->frames, [](const auto& frame) { return frame.which_body == rheonaut_StationFrame_stop_probe_tag; }));
  EXPECT_FALSE(station.find("r1")->stop_path.is_measured);
}

}  // namespace
}  // namespace server
