// Targeted delivery: what the robot does about glucose, with a plant around it.
#include <cmath>
#include <limits>

#include "robot_fw/core/impedance_monitor.hpp"
#include "tests/robot_fw/driven_robot.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

constexpr float kNominalMv = 175, kPatchMv = 120;

// A robot on its way to 0.1 m through a fluid in which a test pours glucose.
class Delivery : public ::testing::Test {
 protected:
  void start(const std::vector<GlucosePatch>& patches, double drift_mv_s = 0, DutyRange duty = {-1, 1}) {
    SimulatedRobotConfig config;
    config.duty = duty;
    config.boot_id = kBootId;
    config.world.glucose.patches = patches;
    config.world.electrode.drift_mv_s = drift_mv_s;
    robot.emplace(config);
    station.emplace(*robot);
    station->welcome.samples_per_frame = 1;
    station->connect();
    station->run(2);
  }
  void go(float setpoint_m) {
    station->send(set_auto(setpoint_m));
    station->step();
  }
  void run_s(double seconds) { station->run(static_cast<int>(std::lround(seconds * 100))); }
  std::vector<protocol::Event> events_of(protocol::EventKind kind) const {
    std::vector<protocol::Event> found;
    for (const auto& event : station->events) {
      if (event.kind == kind) found.push_back(event);
    }
    return found;
  }
  std::size_t detections() const { return events_of(rheonaut_EVENT_KIND_DETECTION).size(); }
  protocol::SubState sub_state() const { return station->samples.rbegin()->second.sub_state; }
  double position_m() const { return robot->world().position_m(); }
  double now_s() const { return 1e-6 * static_cast<double>(robot->robot_time_us()); }
  // One tick after another in which the electrode is off by 55 mV upwards, so that glucose reads as none, or is right.
  template <class IsOff>
  void run_chattering_s(double seconds, IsOff is_off) {
    for (int k = 0; k < std::lround(seconds * 100); ++k) {
      const bool off = is_off(std::lround(now_s() * 100));
      robot->world().set_fault(Sensor::electrode,
                               {off ? SensorFaultKind::offset : SensorFaultKind::none, kNominalMv - kPatchMv});
      station->step();
    }
  }

  std::optional<SimulatedRobot> robot;
  std::optional<StationPeer> station;
};

constexpr double kNever = std::numeric_limits<double>::infinity();

GlucosePatch between(double start_m, double end_m, double mixed_at_s = kNever) {
  return {.position_m = (start_m + end_m) / 2, .length_m = end_m - start_m, .removed_at_s = mixed_at_s};
}

// From 0.05 m on.
std::vector<GlucosePatch> patch(double end_m, double mixed_at_s = kNever) { return {between(0.05, end_m, mixed_at_s)}; }

TEST_F(Delivery, HoldsWhereItFindsGlucoseUntilThatHasMixedAndGoesOn) {
  start(patch(0.08, 5));
  go(0.1F);
  run_s(3);
  ASSERT_EQ(detections(), 1u);
  const auto started = events_of(rheonaut_EVENT_KIND_DELIVERY_STARTED);
  ASSERT_EQ(started.size(), 1u);
  EXPECT_EQ(started[0].value, kPatchMv);
  EXPECT_GT(started[0].position_m, 0.05F);
  EXPECT_LT(started[0].position_m, 0.06F);
  EXPECT_EQ(sub_state(), rheonaut_SUB_STATE_DELIVERING);
  EXPECT_NEAR(position_m(), started[0].position_m, 0.002);
  EXPECT_EQ(station->samples.rbegin()->second.setpoint_m, 0.1F);
  EXPECT_EQ(station->samples.rbegin()->second.reference_m, started[0].position_m);
  run_s(5);
  const auto ended = events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED);
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].cause, rheonaut_EVENT_CAUSE_IMPEDANCE);
  const double held_s = 5 + 0.5 - 1e-6 * static_cast<double>(started[0].event_robot_time_us);
  EXPECT_NEAR(ended[0].value, held_s, 0.03);  // mixed at 5 s, and 50 readings
  EXPECT_EQ(sub_state(), rheonaut_SUB_STATE_HOLDING);
  EXPECT_NEAR(position_m(), 0.1, 0.002);
  EXPECT_EQ(detections(), 1u);
}

TEST_F(Delivery, APatchThatNeverMixesIsLeftAtTheLimit) {
  start({between(0.05, 0.1), between(0.2, 9)});
  station->send(set_parameter("delivery_limit_s", 4));
  go(0.15F);
  run_s(10);
  const auto ended = events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED);
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].cause, rheonaut_EVENT_CAUSE_LIMIT);
  EXPECT_NEAR(ended[0].value, 4, 0.02);
  EXPECT_EQ(detections(), 1u);  // not again in the same patch
  EXPECT_NEAR(position_m(), 0.15, 0.002);
  go(0.25F);
  run_s(3);
  EXPECT_EQ(detections(), 2u);  // armed again in between
  EXPECT_EQ(sub_state(), rheonaut_SUB_STATE_DELIVERING);
}

TEST_F(Delivery, ASensorThatDriftsBy30MvCostsOneDeliveryAtMost) {
  start({}, 0.5);
  station->send(set_parameter("delivery_limit_s", 3));
  go(0.1F);
  run_s(60);
  EXPECT_EQ(detections(), 1u);
  ASSERT_EQ(events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED).size(), 1u);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED)[0].cause, rheonaut_EVENT_CAUSE_LIMIT);
  EXPECT_EQ(sub_state(), rheonaut_SUB_STATE_HOLDING);
}

TEST_F(Delivery, ADriftWithinTheBandIsNothing) {
  start({}, 19.0 / 61);
  go(0.1F);
  run_s(60);
  EXPECT_EQ(detections(), 0u);
}

TEST_F(Delivery, AnEdgeThatChattersIsNoPatch) {
  start(patch(9));
  station->send(set_auto(0.1F));
  run_chattering_s(10, [](long tick) { return tick % 5 == 0; });  // four readings in glucose, one out of it
  EXPECT_EQ(detections(), 0u);
}

TEST_F(Delivery, AnEdgeThatChattersStartsNoSecondDelivery) {
  start(patch(9));
  station->send(set_parameter("delivery_limit_s", 4));
  go(0.1F);
  run_s(2);
  run_chattering_s(18, [](long tick) { return tick % 40 >= 10; });  // 0.1 s in glucose, 0.3 s out
  EXPECT_EQ(detections(), 1u);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED).size(), 1u);
}

TEST_F(Delivery, ARobotThatOvershootsThePatchComesBackToIt) {
  start(patch(0.0565, 6));  // 6.5 mm: at full speed five readings fit in
  go(0.3F);
  double farthest_m = 0;
  for (int k = 0; k < 400; ++k) {
    station->step();
    farthest_m = std::max(farthest_m, position_m());
  }
  ASSERT_EQ(detections(), 1u);
  EXPECT_GT(farthest_m, 0.0565);  // beyond the patch, where the impedance is nominal
  EXPECT_EQ(sub_state(), rheonaut_SUB_STATE_DELIVERING);
  EXPECT_LT(position_m(), 0.0565);
  run_s(4);
  ASSERT_EQ(events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED).size(), 1u);
  EXPECT_NEAR(1e-6 * static_cast<double>(events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED)[0].event_robot_time_us), 6.5,
              0.05);
}

TEST_F(Delivery, InManualADetectionIsAnEventOnly) {
  start(patch(1, 100));
  for (int k = 0; k < 40; ++k) {
    station->send(set_duty(0.8F));
    run_s(0.1);
  }
  ASSERT_EQ(detections(), 1u);
  EXPECT_TRUE(events_of(rheonaut_EVENT_KIND_DELIVERY_STARTED).empty());
  EXPECT_EQ(robot->core().mode(), rheonaut_MODE_MANUAL);
  EXPECT_EQ(robot->core().duty(), 0.8F);
}

TEST_F(Delivery, EveryEndIsAnEventWithItsCause) {
  using End = std::function<void()>;
  const std::pair<protocol::EventCause, End> ends[] = {
      {rheonaut_EVENT_CAUSE_COMMAND, [this] { station->send(set_setpoint(0.2F)); }},
      {rheonaut_EVENT_CAUSE_COMMAND, [this] { station->send(set_manual()); }},
      {rheonaut_EVENT_CAUSE_COMMAND, [this] { station->send(set_auto(0.2F)); }},
      {rheonaut_EVENT_CAUSE_COMMAND, [this] { station->send(emergency_stop()); }},
      {rheonaut_EVENT_CAUSE_LINK_LOSS,
       [this] {
         station->attentive = false;
         run_s(1.2);
         station->attentive = true;
       }},
  };
  for (const auto& [cause, end] : ends) {
    start(patch(0.08, 1000));
    go(0.1F);
    run_s(3);
    ASSERT_EQ(sub_state(), rheonaut_SUB_STATE_DELIVERING);
    end();
    run_s(0.1);
    const auto ended = events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED);
    ASSERT_EQ(ended.size(), 1u);
    EXPECT_EQ(ended[0].cause, cause);
    EXPECT_GT(ended[0].value, 1);
    EXPECT_NE(sub_state(), rheonaut_SUB_STATE_DELIVERING);
  }
}

TEST_F(Delivery, CanBeSwitchedOff) {
  start(patch(0.08, 1000));
  station->send(set_parameter("impedance_monitor", 0));
  go(0.1F);
  run_s(3);
  EXPECT_EQ(detections(), 0u);
  EXPECT_NEAR(position_m(), 0.1, 0.002);
}

TEST_F(Delivery, AMotorWithoutReverseDeliversWhereItComesToRest) {
  start(patch(0.08, 5), 0, {0, 1});
  go(0.2F);
  run_s(4.5);
  ASSERT_EQ(sub_state(), rheonaut_SUB_STATE_DELIVERING);
  EXPECT_GT(position_m(), 0.06);  // it has shot beyond the place and cannot come back
  run_s(1.5);
  const auto ended = events_of(rheonaut_EVENT_KIND_DELIVERY_ENDED);
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].cause, rheonaut_EVENT_CAUSE_IMPEDANCE);
}

TEST_F(Delivery, WhatManualHasFoundIsDeliveredToOnceInAuto) {
  start({between(-1, 9)});
  station->send(set_parameter("delivery_limit_s", 2));
  run_s(1);
  EXPECT_EQ(detections(), 1u);
  go(0.1F);
  run_s(1);
  EXPECT_EQ(detections(), 2u);
  EXPECT_EQ(sub_state(), rheonaut_SUB_STATE_DELIVERING);
  run_s(4);
  go(0.2F);  // auto anew: the same glucose, already delivered to
  run_s(1);
  EXPECT_EQ(detections(), 2u);
}

TEST_F(Delivery, GlucoseThatComesAndGoesDuringADeliveryIsTheSame) {
  start(patch(9));
  go(0.1F);
  run_s(2);
  for (int k = 0; k < 2000; ++k) {  // in the band, but not mixed; and back
    const bool diluted = k % 100 >= 10;
    robot->world().set_fault(Sensor::electrode, {diluted ? SensorFaultKind::offset : SensorFaultKind::none, 38});
    station->step();
  }
  EXPECT_EQ(sub_state(), rheonaut_SUB_STATE_DELIVERING);
  EXPECT_EQ(detections(), 1u);
}

TEST_F(Delivery, TheElectrodesFaultIsKnownWhenTheMonitorIsSwitchedOn) {
  start({});
  robot->world().set_fault(Sensor::electrode, {SensorFaultKind::missing, 0});
  run_s(0.5);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_SENSOR_FAULT).size(), 1u);
  station->send(set_parameter("impedance_monitor", 0));
  run_s(0.1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_SENSOR_RECOVERED).size(), 1u);
  robot->world().set_fault(Sensor::electrode, {});
  run_s(4);
  station->send(set_parameter("impedance_monitor", 1));
  run_s(0.1);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_SENSOR_FAULT).size(), 1u);  // it has recovered meanwhile
  EXPECT_EQ(station->samples.rbegin()->second.flags & rheonaut_TELEMETRY_FLAG_SENSOR_FAULT, 0u);
}

TEST(ImpedanceMonitor, TakesFiveReadingsInARow) {
  ImpedanceMonitor monitor;
  for (int k = 0; k < 4; ++k) EXPECT_FALSE(monitor.step(kPatchMv, true, true, {}));
  EXPECT_FALSE(monitor.step(kNominalMv, true, true, {}));
  for (int k = 0; k < 4; ++k) EXPECT_FALSE(monitor.step(kPatchMv, true, true, {}));
  EXPECT_TRUE(monitor.step(kPatchMv, true, true, {}));
}

TEST(ImpedanceMonitor, ReadingsThatCannotBeUsedAreNoGlucose) {
  ImpedanceMonitor monitor;
  for (int k = 0; k < 20; ++k) EXPECT_FALSE(monitor.step(5, false, true, {}));
}

TEST(ImpedanceMonitor, IsArmedAgainAfter50ReadingsInTheBand) {
  ImpedanceMonitor monitor;
  const auto detects = [&] {
    bool detected = false;
    for (int k = 0; k < 5; ++k) detected = monitor.step(kPatchMv, true, true, {});
    return detected;
  };
  EXPECT_TRUE(detects());
  for (int k = 0; k < 49; ++k) monitor.step(kNominalMv + 19, true, true, {});
  EXPECT_FALSE(detects());
  for (int k = 0; k < 50; ++k) monitor.step(kNominalMv + 19, true, true, {});
  EXPECT_TRUE(detects());
}

TEST(ImpedanceMonitor, HasMixedAfter50ReadingsInTheNarrowBandTakenInPlace) {
  ImpedanceMonitor monitor;
  for (int k = 0; k < 100; ++k) monitor.step(kNominalMv + 16, true, true, {});
  EXPECT_FALSE(monitor.mixed());
  for (int k = 0; k < 100; ++k) monitor.step(kNominalMv, true, false, {});
  EXPECT_FALSE(monitor.mixed());
  for (int k = 0; k < 49; ++k) monitor.step(kNominalMv - 14, true, true, {});
  EXPECT_FALSE(monitor.mixed());
  monitor.step(kNominalMv - 14, true, true, {});
  EXPECT_TRUE(monitor.mixed());
}

}  // namespace
}  // namespace robot_fw
