// What the robot does without a station: link_loss_action and its limit.
#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

constexpr float kStop = 0, kHold = 1, kGoOn = 2;

class LinkLoss : public DrivenRobot {
 protected:
  void lose_link_on_the_way(float action, float limit_s) {
    ASSERT_EQ(answer(set_parameter("link_loss_action", action)), "accepted");
    ASSERT_EQ(answer(set_parameter("link_loss_limit_s", limit_s)), "accepted");
    ASSERT_EQ(answer(set_auto(0.5F)), "accepted");
    station.attentive = false;
    station.run(102);  // the time-out is 1 s
    ASSERT_TRUE(core().link_lost());
    lost_at_m = robot.world().position_m();
  }

  double lost_at_m = 0;
};

TEST_F(LinkLoss, StopIsTheDefault) {
  order(set_auto(0.5F));
  station.attentive = false;
  station.run(102);
  expect_at_rest();
}

TEST_F(LinkLoss, StopEndsAuto) {
  lose_link_on_the_way(kStop, 5);
  expect_at_rest();
}

TEST_F(LinkLoss, HoldStaysWhereTheLinkWasLostAndThenStops) {
  lose_link_on_the_way(kHold, 3);
  station.run(250);
  EXPECT_EQ(mode(), "auto");
  ASSERT_TRUE(last().setpoint_m.has_value());
  EXPECT_NEAR(*last().setpoint_m, lost_at_m, 0.002);
  EXPECT_NEAR(robot.world().position_m(), lost_at_m, 0.003);
  EXPECT_EQ(last().sub_state, rheonaut_SUB_STATE_HOLDING);
  station.run(55);
  expect_at_rest();
  int ends = 0;
  for (const auto& event : station.events) {
    ends += event.kind == rheonaut_EVENT_KIND_MODE_CHANGED && event.cause == rheonaut_EVENT_CAUSE_LINK_LOSS;
  }
  EXPECT_EQ(ends, 1);
}

TEST_F(LinkLoss, GoOnGoesOnAndThenStops) {
  lose_link_on_the_way(kGoOn, 2);
  station.run(195);
  EXPECT_EQ(mode(), "auto");
  EXPECT_EQ(last().setpoint_m, 0.5F);
  EXPECT_GT(robot.world().position_m(), lost_at_m + 0.1);
  station.run(10);
  expect_at_rest();
}

TEST_F(LinkLoss, ALinkThatComesBackInTimeEndsTheLimit) {
  lose_link_on_the_way(kGoOn, 2);
  station.run(100);
  station.attentive = true;
  station.run(300);
  EXPECT_FALSE(core().link_lost());
  EXPECT_EQ(mode(), "auto");
  EXPECT_EQ(last().setpoint_m, 0.5F);
}

TEST_F(LinkLoss, AHeldRobotDoesNotMoveByItselfWhenTheLinkComesBack) {
  lose_link_on_the_way(kHold, 5);
  station.run(200);
  station.attentive = true;
  station.run(200);
  EXPECT_EQ(mode(), "auto");
  EXPECT_NEAR(robot.world().position_m(), lost_at_m, 0.003);
}

TEST_F(LinkLoss, AManualDutyStopsWhateverTheAction) {
  order(set_parameter("link_loss_action", kGoOn));
  order(set_parameter("link_timeout_ms", 100));
  station.disconnect();
  station.connect();
  order(set_duty(0.5F));
  station.attentive = false;
  station.run(12);
  EXPECT_TRUE(core().link_lost());
  expect_at_rest();
}

TEST_F(LinkLoss, AStopOnANewConnectionEndsItAtOnce) {
  lose_link_on_the_way(kGoOn, 30);
  station.disconnect();
  station.connect();
  station.send(emergency_stop());
  EXPECT_EQ(core().duty(), 0);
  EXPECT_EQ(mode(), "emergency");
}

}  // namespace
}  // namespace robot_fw
