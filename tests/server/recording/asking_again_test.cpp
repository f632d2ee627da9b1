// What is missing is asked for while the robot may still have it, and listed when it has not.
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using Rows = std::vector<std::string>;

class AskingAgainTest : public RecordingTest {
 protected:
  Rows event_gaps() {
    return rows(
        "SELECT robot_id, first_event_seq, last_event_seq, cause FROM event_gap JOIN boot USING (boot_key)"
        " ORDER BY boot_key, first_event_seq");
  }
  void send_event(const TestRobot& robot, std::uint64_t event_seq) {
    station::RobotEvent event;
    event.robot_id = robot.id;
    event.boot_id = robot.boot_id;
    event.event_seq = event_seq;
    event.oldest_event_seq = robot.oldest_event_seq;
    event.kind = "detection";
    recorder_->on_event(station::RobotState{}, event);
  }
  // It has made nothing yet.
  TestRobot rebooted(station::BootId boot_id) const {
    TestRobot robot = robot_;
    robot.boot_id = boot_id;
    robot.next_seq = robot.next_event_seq = 0;
    return robot;
  }

  TestRobot robot_;
};

TEST_F(AskingAgainTest, ForEveryHoleAtOnce) {
  start();
  connect(robot_);
  for (std::uint64_t first = 0; first < 400; first += 40) send(robot_, first, 20);
  ASSERT_TRUE(clock_.run_until([&] { return !missing_.empty(); }, 2s));
  EXPECT_EQ(missing_, (std::vector<Missing>{{20, 360}}));
  send(robot_, 20, 340);  // most of it a second time
  flush();
  EXPECT_EQ(durable_next_seq_, 380u);
  EXPECT_EQ(number("SELECT count(*) FROM sample"), 380);
}

TEST_F(AskingAgainTest, AThousandRobotsWithinTwoSeconds) {
  start();
  for (station::BootId boot = 1; boot <= 1000; ++boot) {
    TestRobot robot;
    robot.id = "r" + std::to_string(boot);
    robot.boot_id = boot;
    connect(robot);
    send(robot, 0, 10);
    send(robot, 20, 10);
  }
  clock_.run_for(2s);
  EXPECT_GE(missing_.size(), 1000u);
}

TEST_F(AskingAgainTest, EventsThatARebootTookAreListed) {
  robot_.next_event_seq = 5;
  start();
  connect(robot_);
  send_event(robot_, 0);
  send_event(robot_, 3);
  TestRobot rebooted = robot_;
  rebooted.boot_id = 99;
  rebooted.next_event_seq = 0;
  connect(rebooted);
  flush();
  EXPECT_EQ(event_gaps(), (Rows{"nemo|1|2|reboot", "nemo|4|4|reboot"}));
}

TEST_F(AskingAgainTest, EventsThatARebootTookWhileTheStationWasDownAreListed) {
  robot_.next_event_seq = 5;
  start();
  connect(robot_);
  send_event(robot_, 0);
  send_event(robot_, 3);
  flush();
  stop();
  start();
  TestRobot rebooted = robot_;
  rebooted.boot_id = 99;
  rebooted.next_event_seq = 0;
  connect(rebooted);
  flush();
  EXPECT_EQ(event_gaps(), (Rows{"nemo|1|2|reboot", "nemo|4|4|reboot"}));
  EXPECT_EQ(rows("SELECT durable_next_event_seq FROM boot WHERE ended_next_seq IS NOT NULL"), Rows{"5"});
}

// A boot that the station has read from the disk again, without connecting with it, ends with the next one all the
// same.
TEST_F(AskingAgainTest, ABootThatWasReadAgainAndOvertakenEndsOnce) {
  robot_.next_event_seq = 5;
  start();
  connect(robot_);
  send(robot_, 10, 10);
  robot_.next_seq = 20;
  send_event(robot_, 0);
  flush();
  stop();
  start();
  ASSERT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_NONE);  // its connection was not to be
  const TestRobot second = rebooted(99);
  connect(second);
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_STATION_BUSY);
  flush();
  clock_.run_for(1s);
  robot_.next_event_seq = 7;
  connect(robot_);
  for (std::uint64_t seq = 0; seq < 6; ++seq) send_event(robot_, seq);
  send(robot_, 0, 20);
  flush();
  connect(rebooted(100));
  flush();
  EXPECT_FALSE(recorder_->failing()) << recorder_->problem();
  EXPECT_EQ(event_gaps(), (Rows{"nemo|1|4|reboot", "nemo|6|6|reboot"}));
  EXPECT_EQ(rows("SELECT event_seq FROM event WHERE event_seq IS NOT NULL ORDER BY event_row"), (Rows{"0", "5"}));
  EXPECT_EQ(rows("SELECT first_seq, last_seq FROM gap ORDER BY first_seq"), Rows{"0|9"});
  EXPECT_EQ(number("SELECT count(*) FROM sample"), 10);
}

// What the disk says of a boot while it ends there, may be what it was before.
TEST_F(AskingAgainTest, ABootIsNotReadWhileAnotherOneTakesItsPlace) {
  robot_.next_event_seq = 5;
  start();
  connect(robot_);
  flush();
  stop();
  start();
  const TestRobot second = rebooted(99);
  connect(second);
  EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_STATION_BUSY);
  flush();
  clock_.run_for(1s);
  connect(robot_);
  for (std::uint64_t seq = 0; seq < 5; ++seq) send_event(robot_, seq);
  flush();
  EXPECT_EQ(event_gaps(), Rows{"nemo|0|4|reboot"});
  EXPECT_EQ(number("SELECT count(*) FROM event WHERE event_seq IS NOT NULL"), 0);
}

// As samples are: the robot lost them, because the station had refused them.
TEST_F(AskingAgainTest, RefusedEventsThatAreLostLaterAreOfTheFullQueue) {
  storage::RecorderOptions options;
  options.max_queued_records = 2;
  start(options);
  connect(robot_);
  for (std::uint64_t seq = 0; seq < 5; ++seq) send_event(robot_, seq);  // within one instant: 2 to 4 are refused
  flush();
  robot_.oldest_event_seq = 7;  // too late for these, and two more have never come
  send_event(robot_, 7);
  flush();
  EXPECT_EQ(event_gaps(), (Rows{"nemo|2|4|queue_full", "nemo|5|6|ring_overrun"}));
  EXPECT_EQ(durable_next_event_seq_, 8u);
}

TEST_F(AskingAgainTest, ARefusedEventThatCameAgainIsNotLost) {
  storage::RecorderOptions options;
  options.max_queued_records = 2;
  start(options);
  connect(robot_);
  for (std::uint64_t seq = 0; seq < 4; ++seq) send_event(robot_, seq);
  flush();
  send_event(robot_, 2);
  robot_.oldest_event_seq = 4;
  flush();
  send_event(robot_, 4);
  flush();
  EXPECT_EQ(event_gaps(), Rows{"nemo|3|3|queue_full"});
}

TEST_F(AskingAgainTest, EventsThatTheRingLostBeforeAReconnectionAreListed) {
  start();
  connect(robot_);
  send_event(robot_, 0);
  disconnect(robot_);
  robot_.oldest_event_seq = 7;
  robot_.next_event_seq = 9;
  connect(robot_);
  flush();
  EXPECT_EQ(event_gaps(), Rows{"nemo|1|6|ring_overrun"});
  EXPECT_EQ(durable_next_event_seq_, 7u);
}

}  // namespace
}  // namespace server
