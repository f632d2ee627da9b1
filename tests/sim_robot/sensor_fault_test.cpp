// Each fault of a sensor as the robot sees it: the events of its core, and what its estimate is then worth.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "sim_robot/lab/station_peer.hpp"

namespace sim_robot {
namespace {

class FaultySensor : public ::testing::Test {
 protected:
  void start(std::uint64_t seed = 1) {
    SimulatedRobotConfig config;
    config.world.imu.emplace();
    config.world.imu->missed_read_probability = 0;
    config.world.seed = seed;
    robot.emplace(config);
    station.emplace(*robot);
    station->welcome.samples_per_frame = 1;
    station->connect();
    station->run(2);
  }
  void SetUp() override { start(); }

  int events_of(protocol::EventKind kind) const {
    int count = 0;
    for (const auto& event : station->events) count += event.kind == kind;
    return count;
  }
  int faults() const { return events_of(rheonaut_EVENT_KIND_SENSOR_FAULT); }
  // Ticks until the robot says a fault, at most `most`.
  int ticks_to_fault(int most) {
    for (int k = 1; k <= most; ++k) {
      station->step();
      if (faults() > 0) return k;
    }
    return -1;
  }
  double error_m() const {
    return static_cast<double>(station->samples.rbegin()->second.position_m) - robot->world().position_m();
  }
  double position_sd_m() const { return static_cast<double>(station->samples.rbegin()->second.position_sd_m); }
  // Within 2 sd, or the robot says itself that something does not fit.
  bool is_honest() const {
    return std::abs(error_m()) <= 2 * position_sd_m() || events_of(rheonaut_EVENT_KIND_MODEL_MISMATCH) > 0;
  }

  // 20 s after an offset has come over a robot that holds at 0.1 m.
  bool is_honest_with_an_offset(double offset_m_s2, std::uint64_t seed) {
    start(seed);
    station->send(set_parameter("model_confirmed", 1));
    station->run(2);
    station->send(set_auto(0.1F));
    station->run(500);
    robot->world().set_fault(Sensor::accelerometer, {SensorFaultKind::offset, offset_m_s2});
    station->run(2000);
    return is_honest();
  }

  std::optional<SimulatedRobot> robot;
  std::optional<StationPeer> station;
};

TEST_F(FaultySensor, AStuckAccelerometerIsAnEventAfter100EqualReadings) {
  robot->world().set_fault(Sensor::accelerometer, {.kind = SensorFaultKind::stuck});
  EXPECT_NEAR(ticks_to_fault(200), 100, 2);
  robot->world().set_fault(Sensor::accelerometer, {});
  station->run(105);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_SENSOR_RECOVERED), 1);
}

TEST_F(FaultySensor, AMissingAccelerometerIsAnEventAfter25Ticks) {
  robot->world().set_fault(Sensor::accelerometer, {.kind = SensorFaultKind::missing});
  EXPECT_NEAR(ticks_to_fault(50), 25, 1);
}

TEST_F(FaultySensor, AnAccelerometerBeyond4GIsAnEventAfter5Readings) {
  robot->world().set_fault(Sensor::accelerometer, {SensorFaultKind::offset, 45});
  EXPECT_NEAR(ticks_to_fault(20), 6, 1);  // the sensor takes its next sample within a tick
}

TEST_F(FaultySensor, InAutoALostAccelerometerIsAnEmergency) {
  station->send(set_auto(0.1F));
  station->run(20);
  ASSERT_NE(robot->core().duty(), 0);
  robot->world().set_fault(Sensor::accelerometer, {.kind = SensorFaultKind::missing});
  station->run(30);
  EXPECT_EQ(robot->core().mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(robot->core().duty(), 0);
}

TEST_F(FaultySensor, AnElectrodeThatIsMissingOrOutOfRangeIsAnEventAfter5Readings) {
  robot->world().set_fault(Sensor::electrode, {.kind = SensorFaultKind::missing});
  EXPECT_EQ(ticks_to_fault(20), 5);
  start();
  robot->world().set_fault(Sensor::electrode, {SensorFaultKind::offset, 900});
  EXPECT_EQ(ticks_to_fault(20), 5);
}

TEST_F(FaultySensor, AnElectrodeOffByMoreThanTheBandIsTakenForGlucose) {
  robot->world().set_fault(Sensor::electrode, {SensorFaultKind::offset, -30});
  station->run(20);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DETECTION), 1);
  EXPECT_EQ(faults(), 0);
}

TEST_F(FaultySensor, AStuckElectrodeOverlooksGlucose) {
  robot->world().set_fault(Sensor::electrode, {.kind = SensorFaultKind::stuck});
  robot->world().pour({.position_m = 0, .length_m = 9});
  station->run(200);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DETECTION), 0);
  robot->world().set_fault(Sensor::electrode, {});
  station->run(20);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DETECTION), 1);
}

TEST_F(FaultySensor, ANoisyElectrodeWithinTheBandIsNothing) {
  robot->world().set_fault(Sensor::electrode, {SensorFaultKind::noisy, 5});
  station->run(6000);
  EXPECT_EQ(events_of(rheonaut_EVENT_KIND_DETECTION), 0);
  EXPECT_EQ(faults(), 0);
}

TEST_F(FaultySensor, WithFiveTimesTheNoiseTheEstimateStaysHonest) {
  int honest = 0;
  constexpr int kSeeds = 10;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    start(seed);
    robot->world().set_fault(Sensor::accelerometer, {SensorFaultKind::noisy, 0.058});
    station->send(set_auto(0.1F));
    station->run(2000);
    honest += is_honest();
  }
  EXPECT_GE(honest, 9);
}

// Up to 0.01 m/s² it is tracked as bias, from 0.03 m/s² on the robot says that the model does not fit.
TEST_F(FaultySensor, AnOffsetUnderWayIsTrackedOrSaid) {
  for (const double offset_m_s2 : {0.005, 0.01, 0.03, 0.1, -0.5}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      EXPECT_TRUE(is_honest_with_an_offset(offset_m_s2, seed)) << offset_m_s2 << ", seed " << seed;
    }
  }
}

// Too much for a bias and too little to be told from motion: 94 of 100 trials are within 2 sd or said.
TEST_F(FaultySensor, AnOffsetInBetweenIsSeldomWrongInSilence) {
  int honest = 0;
  constexpr int kSeeds = 20;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) honest += is_honest_with_an_offset(0.02, seed);
  EXPECT_GE(honest, 16);
}

TEST(PerfectSensor, HasNoFaults) {
  World world{WorldConfig{}};
  EXPECT_THROW(world.set_fault(Sensor::accelerometer, {.kind = SensorFaultKind::stuck}), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
