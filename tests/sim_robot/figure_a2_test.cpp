// The paper's glucose experiments through the whole robot: Figure A2, and stopping to deliver in the pulsating flow.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sim_robot/station_peer.hpp"

namespace sim_robot {
namespace {

SimulatedRobotConfig with_a_patch(const GlucosePatch& patch) {
  SimulatedRobotConfig config;
  config.world.glucose.patches = {patch};
  return config;
}

// Drives at constant duty and gives what telemetry says of the impedance over the position.
std::vector<ReceivedSample> pass(const SimulatedRobotConfig& config, double seconds) {
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.welcome.samples_per_frame = 1;
  station.connect();
  station.run(2);
  for (double time_s = 0; time_s < seconds; time_s += 0.1) {
    station.send(set_duty(0.5F));
    station.run(10);
  }
  std::vector<ReceivedSample> samples;
  for (const auto& [seq, sample] : station.samples) samples.push_back(sample);
  return samples;
}

TEST(FigureA2, AConstantSpeedPassShows175Then120Then175) {
  const auto samples = pass(with_a_patch({.position_m = 0.25, .length_m = 0.1, .edge_m = 0.005}), 9);
  ASSERT_GT(samples.back().position_m, 0.35F);
  bool fell = false, rose = false;
  float before_mv = 175;
  for (const ReceivedSample& sample : samples) {
    const float x = sample.position_m, mv = sample.impedance_mv;
    if (x < 0.17F || x > 0.33F) EXPECT_NEAR(mv, 175, 0.01) << x;
    if (x > 0.23F && x < 0.27F) EXPECT_NEAR(mv, 120, 0.01) << x;
    if (x < 0.25F) EXPECT_LE(mv, before_mv + 0.001F) << x;  // down, then up
    if (x > 0.26F) EXPECT_GE(mv, before_mv - 0.001F) << x;
    fell = fell || (mv < 150 && x < 0.25F);
    rose = rose || (mv > 150 && fell && x > 0.25F);
    before_mv = mv;
  }
  EXPECT_TRUE(fell && rose);
}

TEST(FigureA2, TheMarksLieWhereTheHalfwayValueIsCrossed) {
  const auto samples = pass(with_a_patch({.position_m = 0.25, .length_m = 0.1, .edge_m = 0.005}), 9);
  double first_m = 0, last_m = 0;
  for (const ReceivedSample& sample : samples) {
    if (sample.impedance_mv >= 147.5F) continue;
    if (first_m == 0) first_m = static_cast<double>(sample.position_m);
    last_m = static_cast<double>(sample.position_m);
  }
  EXPECT_NEAR(first_m, 0.2, 0.001);
  EXPECT_NEAR(last_m, 0.3, 0.001);
}

// The patch mixes by itself: the robot stays until it has, and goes on.
TEST(StopAndDeliver, WaitsUntilTheGlucoseHasMixedAndGoesOn) {
  SimulatedRobotConfig config = with_a_patch({.position_m = 0.08, .length_m = 0.04, .mixing_m2_s = 1e-4});
  config.world.electrode = kDs550;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.connect();
  station.run(2);
  station.send(set_auto(0.2F));
  station.run(300);
  EXPECT_LT(robot.world().position_m(), 0.1);
  station.run(6000);
  EXPECT_NEAR(robot.world().position_m(), 0.2, 0.002);
  EXPECT_GT(robot.world().impedance_mv(), 155);
  std::vector<protocol::Event> ended;
  for (const auto& event : station.events) {
    if (event.kind == rheonaut_EVENT_KIND_DELIVERY_ENDED) ended.push_back(event);
  }
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].cause, rheonaut_EVENT_CAUSE_IMPEDANCE);
  EXPECT_GT(ended[0].value, 5);
}

// With the true position to steer by, the robot holds its place in the stream.
TEST(StopAndDeliver, HoldsInThePulsatingFlow) {
  SimulatedRobotConfig config = with_a_patch({.position_m = 0.08, .length_m = 0.06, .removed_at_s = 20});
  config.world.vessel.emplace();
  config.world.vessel->pump.mean_flow_m3_s = -0.5 * kPaperFlowM3S;
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.welcome.samples_per_frame = 1;
  station.connect();
  station.run(2);
  station.send(set_auto(0.2F));
  station.run(1500);
  EXPECT_EQ(station.samples.rbegin()->second.sub_state, rheonaut_SUB_STATE_DELIVERING);
  EXPECT_GT(robot.world().position_m(), 0.045);
  EXPECT_LT(robot.world().position_m(), 0.08);
  station.run(1500);
  EXPECT_NEAR(robot.world().position_m(), 0.2, 0.015);
}

}  // namespace
}  // namespace sim_robot
