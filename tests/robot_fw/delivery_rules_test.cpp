// Glucose on the way: where the robot holds, for how long, and when it looks for more. And where it holds alone.
#include "sim_robot/lab/station_peer.hpp"
#include "tests/robot_fw/bare_core.hpp"

namespace robot_fw {
namespace {

constexpr float kClearMv = 175, kGlucoseMv = 120;
constexpr float kGoalM = 0.5F;

// On its way to the setpoint, at a position that the test sets.
class DeliveryRules : public ::testing::Test {
 protected:
  DeliveryRules() {
    core.known_position_m = 0.0F;
    core.tick();
    core.order(sim_robot::set_auto(kGoalM));
    core.tick();
    core.events.clear();
  }
  void read(float impedance_mv, int ticks) {
    core.impedance_mv = impedance_mv;
    core.run(ticks);
  }
  void be_at(float position_m) { core.known_position_m = position_m; }
  std::string sub_state() const { return protocol::text(core.sample.sub_state); }
  float reference_m() const { return core.sample.reference_m[0]; }
  int events_of(protocol::EventKind kind) const {
    int count = 0;
    for (const auto& event : core.events) count += event.kind == kind;
    return count;
  }

  BareCore core;
};

TEST_F(DeliveryRules, HoldsThePositionOfTheFifthReading) {
  for (int i = 1; i <= 8; ++i) {
    be_at(0.001F * static_cast<float>(i));
    read(kGlucoseMv, 1);
    EXPECT_EQ(sub_state(), i < 5 ? "navigating" : "delivering") << i;
    EXPECT_FLOAT_EQ(reference_m(), i < 5 ? kGoalM : 0.005F) << i;
  }
  EXPECT_EQ(core.sample.setpoint_m, kGoalM) << "for afterwards";
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DETECTION), 1);
  EXPECT_FLOAT_EQ(core.events.back().position_m, 0.005F);
  EXPECT_EQ(core.events.back().value, kGlucoseMv);
}

TEST_F(DeliveryRules, FourReadingsAreNone) {
  for (int i = 0; i < 10; ++i) {
    read(kGlucoseMv, 4);
    read(kClearMv, 1);
  }
  EXPECT_EQ(sub_state(), "navigating");
  EXPECT_TRUE(core.events.empty());
}

TEST_F(DeliveryRules, ReadingsThatCannotBeAreNone) {
  for (int i = 0; i < 10; ++i) {
    read(19, 4);
    read(kGlucoseMv, 4);
  }
  EXPECT_EQ(sub_state(), "navigating");
}

TEST_F(DeliveryRules, GoesOnToItsSetpointWhenTheGlucoseHasMixed) {
  read(kGlucoseMv, 5);
  read(kClearMv, 49);
  EXPECT_EQ(sub_state(), "delivering");
  read(kClearMv, 1);
  EXPECT_EQ(sub_state(), "navigating");
  EXPECT_EQ(reference_m(), kGoalM);
  EXPECT_NEAR(core.events.back().value, 0.5, 1e-3) << "seconds";
}

TEST_F(DeliveryRules, OneReadingBeyondTheExitBandStartsTheFiftyAnew) {
  read(kGlucoseMv, 5);
  for (int i = 0; i < 5; ++i) {
    read(kClearMv, 49);
    read(kClearMv - 15.5F, 1);
  }
  EXPECT_EQ(sub_state(), "delivering");
  read(kClearMv - 15, 50);
  EXPECT_EQ(sub_state(), "navigating");
}

TEST_F(DeliveryRules, ReadingsFromElsewhereSayNothingAboutThePlace) {
  read(kGlucoseMv, 5);
  be_at(0.0055F);
  read(kClearMv, 500);
  be_at(-0.0055F);
  read(kClearMv, 500);
  EXPECT_EQ(sub_state(), "delivering");
  be_at(0.0045F);
  read(kClearMv, 50);
  EXPECT_EQ(sub_state(), "navigating");
}

TEST_F(DeliveryRules, TheSameGlucoseIsNotFoundTwice) {
  read(kGlucoseMv, 5);
  core.order(sim_robot::set_setpoint(kGoalM));
  read(kGlucoseMv, 500);
  EXPECT_EQ(sub_state(), "navigating");
  read(kClearMv, 49);
  read(kGlucoseMv, 10);
  EXPECT_EQ(sub_state(), "navigating");
  read(kClearMv, 50);
  read(kGlucoseMv, 5);
  EXPECT_EQ(sub_state(), "delivering");
}

TEST_F(DeliveryRules, WithoutTheMonitorThereIsNeitherGlucoseNorAFault) {
  core.order(sim_robot::set_manual());
  core.order(sim_robot::set_parameter("impedance_monitor", 0));
  core.order(sim_robot::set_auto(kGoalM));
  read(kGlucoseMv, 100);
  read(0, 100);
  EXPECT_EQ(sub_state(), "navigating");
  EXPECT_EQ(core.sample.flags & rheonaut_TELEMETRY_FLAG_SENSOR_FAULT, 0u);
}

TEST_F(DeliveryRules, AnElectrodeThatCannotBeBelievedKeepsTheRobotOutOfAuto) {
  read(0, 5);
  EXPECT_EQ(core.robot.mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(core.order(sim_robot::clear_emergency(core.robot.emergency_id())).reason,
            rheonaut_REJECT_REASON_CAUSE_STANDS);
  read(kClearMv, 50);
  EXPECT_EQ(core.order(sim_robot::clear_emergency(core.robot.emergency_id())).result, rheonaut_COMMAND_RESULT_ACCEPTED);
  read(1001, 5);
  EXPECT_EQ(core.robot.mode(), rheonaut_MODE_MANUAL) << "in manual the operator may go on by eye";
  EXPECT_EQ(core.order(sim_robot::set_auto(kGoalM)).reason, rheonaut_REJECT_REASON_CAUSE_STANDS);
  read(kClearMv, 50);
  EXPECT_EQ(core.order(sim_robot::set_auto(kGoalM)).result, rheonaut_COMMAND_RESULT_ACCEPTED);
}

class HoldAlone : public DeliveryRules {
 protected:
  HoldAlone() {
    core.order(sim_robot::set_manual());
    core.order(sim_robot::set_parameter("link_loss_action", 1));
    core.order(sim_robot::set_parameter("position_limit_max_m", kGoalM));
    core.order(sim_robot::set_auto(kGoalM));
    core.tick();
  }
  // Silence, 1 mm a tick.
  void lose_link() {
    core.attentive = false;
    for (int i = 0; i < 20; ++i) {
      be_at(*core.known_position_m + 0.001F);
      core.tick();
      if (core.robot.link_lost() && !lost_at_m) lost_at_m = core.known_position_m;
    }
  }
  std::optional<float> lost_at_m;
};

TEST_F(HoldAlone, MakesThePositionOfThatTickTheSetpoint) {
  lose_link();
  ASSERT_TRUE(lost_at_m.has_value());
  EXPECT_EQ(core.sample.setpoint_m, *lost_at_m);
  EXPECT_EQ(reference_m(), *lost_at_m);
  EXPECT_NE(core.robot.duty(), 0);
}

TEST_F(HoldAlone, EndsTheDelivery) {
  read(kGlucoseMv, 5);
  ASSERT_EQ(sub_state(), "delivering");
  lose_link();
  EXPECT_EQ(core.sample.setpoint_m, *lost_at_m);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED), 1);
}

TEST_F(HoldAlone, StaysWithinThePositionLimits) {
  core.order(sim_robot::inject_disturbance(0.2F));  // it believes to be farther than it is
  be_at(0.4F);
  lose_link();
  EXPECT_FLOAT_EQ(core.sample.setpoint_m, *lost_at_m + 0.2F) << "the limits hold for where it is";
}

TEST_F(HoldAlone, EndsWithTheLimitAndNotWhenTheLinkIsBackBefore) {
  lose_link();
  core.attentive = true;
  core.heartbeat();
  core.run(600);
  EXPECT_EQ(core.robot.mode(), rheonaut_MODE_AUTO);
  core.attentive = false;
  core.run(600);
  EXPECT_EQ(core.robot.mode(), rheonaut_MODE_MANUAL);
  EXPECT_EQ(core.robot.duty(), 0);
}

}  // namespace
}  // namespace robot_fw
