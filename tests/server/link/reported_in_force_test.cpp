// From which sample on the station takes for in force what a robot says.
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

class ReportedInForceTest : public LinkTest {
 protected:
  void say_controller(TestRobot& robot, float kp, std::uint64_t robot_time_us, std::uint32_t checksum = 0) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_controller_tag;
    frame.robot_time_us = robot_time_us;
    frame.body.controller.kp = kp;
    frame.body.controller.checksum = checksum;
    robot.send(frame);
    clock.settle();
  }
  const station::InForceRecord& latest() const { return sink.in_force.back(); }
};

TEST_F(ReportedInForceTest, AChangeHoldsFromTheFirstSampleMadeAfterIt) {
  auto* robot = connect();
  const std::uint64_t now_us = robot->robot_now_us() + 100'000;
  robot->send_samples(0, 5, now_us, 0);
  say_controller(*robot, 1, now_us + 50'000);  // sample 5 is made now
  ASSERT_EQ(sink.in_force.size(), 1U);
  EXPECT_EQ(latest().first_seq, 5U);
  EXPECT_FALSE(latest().is_change);
  say_controller(*robot, 2, now_us + 72'000);  // 5 to 7 are made and have not arrived
  ASSERT_EQ(sink.in_force.size(), 2U);
  EXPECT_EQ(latest().first_seq, 8U);
  EXPECT_TRUE(latest().is_change);
  robot->send_samples(5, 5, now_us + 50'000, 0);
  say_controller(*robot, 3, now_us + 90'001);
  EXPECT_EQ(latest().first_seq, 10U);
}

TEST_F(ReportedInForceTest, WhatARobotSaysWhenItConnectsAgainIsNoChange) {
  auto* before = connect();
  say_controller(*before, 1, 0);
  say_controller(*before, 2, 0);
  EXPECT_TRUE(latest().is_change);
  before->link.cut();
  clock.settle();
  auto* robot = dial();
  robot->booted_at_us = before->booted_at_us;
  auto hello = TestRobot::hello_frame();
  hello.body.hello.next_seq = 300;
  robot->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  const std::uint64_t heard_us = robot->robot_now_us();
  say_controller(*robot, 3, heard_us);
  EXPECT_FALSE(latest().is_change);
  EXPECT_GE(latest().first_seq, 300U);
  EXPECT_LE(latest().first_seq, 302U);
}

TEST_F(ReportedInForceTest, TheChecksumOfTheControllerIsThatOfTheLastReport) {
  auto* robot = connect();
  say_controller(*robot, 1, robot->robot_now_us(), 77);
  EXPECT_EQ(station.find("r1")->controller_checksum, 77U);
  say_controller(*robot, 2, robot->robot_now_us(), 78);
  EXPECT_EQ(station.find("r1")->controller_checksum, 78U);
}

}  // namespace
}  // namespace server
