// How soon a robot is read: by who waits for what it sends.
#include <string>

#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

using net::ReadPace;

// One that answers the probes of its clock, so that no answer is awaited for long.
class ReadPaceTest : public LinkTest {
 protected:
  ReadPaceTest() {
    robot = connect();
    answer_probe();
  }

  void answer_probe() {
    for (const auto& heartbeat : robot->heartbeats()) {
      protocol::RobotFrame answer = rheonaut_RobotFrame_init_zero;
      answer.which_body = rheonaut_RobotFrame_heartbeat_tag;
      answer.body.heartbeat.echo_station_time_us = heartbeat.station_time_us;
      answer.body.heartbeat.echo_received_at_robot_us = robot->robot_now_us();
      robot->send(answer);
    }
    clock.settle();
  }
  // After the robot has said something, and answered what it was asked.
  ReadPace pace() {
    answer_probe();
    return robot->link.second_pace();
  }

  TestRobot* robot;
};

TEST_F(ReadPaceTest, ARobotThatNobodyWatchesOrCommandsIsQuiet) { EXPECT_EQ(pace(), ReadPace::quiet); }

TEST_F(ReadPaceTest, AProbeOfItsClockIsAwaited) {
  EXPECT_EQ(pace(), ReadPace::quiet);
  const auto before = robot->heartbeats().size();
  const auto has_probe = [&] {
    return robot->heartbeats().size() > before && robot->heartbeats().back().station_time_us;
  };
  ASSERT_TRUE(clock.run_until(has_probe, 2s));
  EXPECT_EQ(robot->link.second_pace(), ReadPace::awaited);
  EXPECT_EQ(pace(), ReadPace::quiet);
}

// SAFETY: the pause of a quiet robot delays no answer to a stop.
TEST_F(ReadPaceTest, AStopOfAQuietRobotIsAwaitedFromTheMomentItLeaves) {
  ASSERT_EQ(pace(), ReadPace::quiet);
  stop_robot();
  loop.restart();
  while (robot->link.second_pace() != ReadPace::awaited) ASSERT_GT(loop.run_one(), 0U);
  EXPECT_TRUE(robot->commands().empty()) << "the frame has left, and nobody can have answered it yet";
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  EXPECT_EQ(pace(), ReadPace::prompt) << "how it obeys is to be seen as well";
}

TEST_F(ReadPaceTest, OneThatIsControlledIsPromptUntilSomeTimeAfterTheLastCommand) {
  submit(set_duty(0.1F));
  clock.settle();
  EXPECT_EQ(robot->link.second_pace(), ReadPace::awaited);
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_REJECTED, 0);
  EXPECT_EQ(pace(), ReadPace::prompt);
  tasks.spawn("control", station.watch_control());
  clock.run_for(4'900ms);
  EXPECT_TRUE(station.find("r1")->control.holder.empty());
  EXPECT_EQ(pace(), ReadPace::prompt);
  clock.run_for(200ms);
  EXPECT_EQ(pace(), ReadPace::quiet);
  ASSERT_TRUE(station.control({"r1", "session:1", "", station::ControlAction::take, 10s, "a test"}));
  EXPECT_EQ(pace(), ReadPace::prompt);
  clock.run_for(9s);
  EXPECT_EQ(pace(), ReadPace::prompt) << "without a command";
  clock.run_for(2s);
  EXPECT_EQ(pace(), ReadPace::quiet);
}

TEST_F(ReadPaceTest, OneWhoseStopIsPendingIsPrompt) {
  stop_robot(100ms);
  clock.run_for(6s);
  EXPECT_TRUE(station.find("r1")->pending_stop);
  EXPECT_EQ(robot->link.second_pace(), ReadPace::awaited);
}

class Watcher final : public station::StationSink {
 public:
  bool watches(const station::RobotId& robot) const override { return robot == watched; }
  station::RobotId watched;
};

TEST_F(ReadPaceTest, OneThatIsWatchedIsPrompt) {
  Watcher watcher;
  station.add_sink(watcher);
  watcher.watched = "another";
  EXPECT_EQ(pace(), ReadPace::quiet);
  watcher.watched = "r1";
  EXPECT_EQ(pace(), ReadPace::prompt);
  watcher.watched.clear();
  EXPECT_EQ(pace(), ReadPace::quiet);
  tasks.stop();
  clock.settle();
}

// A robot may keep what is not acknowledged in 2.9 kB, so that long pauses would slow down what it sends again.
TEST_F(ReadPaceTest, OneThatSendsMuchAtOnceIsPromptForASecond) {
  std::vector<std::uint8_t> much;
  for (std::uint64_t seq = 0; much.size() <= 2048; seq += 5) {
    const auto frame = TestRobot::samples_frame(seq, 5, robot->robot_now_us() + seq * 10'000, 0);
    std::vector<std::uint8_t> bytes(protocol::kMaxFramedBytes);
    bytes.resize(protocol::write_frame(frame, bytes.data(), bytes.size()));
    much.insert(much.end(), bytes.begin(), bytes.end());
  }
  robot->send_bytes(much);
  clock.settle();
  EXPECT_EQ(pace(), ReadPace::prompt);
  clock.run_for(1s);
  EXPECT_EQ(pace(), ReadPace::quiet);
}

// One with ten samples a frame sends ten frames a second: to read it every 30 ms would take three times as many reads.
TEST_F(ReadPaceTest, OneThatSendsMoreRarelyThanEachPauseIsPromptForTenSeconds) {
  ASSERT_EQ(pace(), ReadPace::quiet);
  robot->link.call_second();
  EXPECT_EQ(robot->link.second_pace(), ReadPace::prompt);
  clock.run_for(9'900ms);
  EXPECT_EQ(pace(), ReadPace::prompt);
  clock.run_for(200ms);
  EXPECT_EQ(pace(), ReadPace::quiet);
}

}  // namespace
}  // namespace server
