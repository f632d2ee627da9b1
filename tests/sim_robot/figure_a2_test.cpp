// The paper's glucose experiments through the whole robot: Figure A2, and stopping to deliver in the pulsating flow.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sim_robot/lab/station_peer.hpp"
#include "tests/sim_robot/story.hpp"

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

class StopAndDeliver : public ::testing::Test, protected Story {
 protected:
  Setting setting;
};

// The patch mixes by itself: the robot stays until it has, and goes on.
TEST_F(StopAndDeliver, WaitsUntilTheGlucoseHasMixedAndGoesOn) {
  setting.robot = with_a_patch({.position_m = 0.08, .length_m = 0.04, .mixing_m2_s = 1e-4});
  setting.robot.world.electrode = kDs550;
  begin(setting);
  go_to(0.2);
  await(delivering(), {.limit_s = 3});
  const ReceivedEvent ended = expect_event("delivery_ended", {.within_s = 60});
  EXPECT_EQ(ended.cause, "impedance");
  EXPECT_GT(ended.value, 5);
  EXPECT_LT(ended.position_m, 0.1);
  await(holding());
  holds(in_truth(position().within(0.002).of(0.2) and impedance().above(155)), {.for_s = 20});
  expect_no_event("delivery_ended");
}

// With the true position to steer by, the robot holds its place in the stream.
TEST_F(StopAndDeliver, HoldsInThePulsatingFlow) {
  setting.robot = with_a_patch({.position_m = 0.08, .length_m = 0.06, .removed_at_s = 20});
  setting.robot.world.vessel.emplace();
  setting.robot.world.vessel->pump.mean_flow_m3_s = -0.5 * kPaperFlowM3S;
  begin(setting);
  go_to(0.2);
  await(delivering(), {.limit_s = 10});
  pass(5);
  holds(delivering() and in_truth(position().above(0.045) and position().below(0.08)), {.for_s = 5});
  expect_event("delivery_ended", {.within_s = 15});
  pass(10);
  expect(in_truth(position().within(0.015).of(0.2)));
}

}  // namespace
}  // namespace sim_robot
