// The same flow rate passes every cross-section, carries the robot, and is felt only where it changes.
#include "sim_robot/world/vessel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>

#include "sim_robot/world/world.hpp"

namespace sim_robot {
namespace {

constexpr double kRatio = 2.46059;

double area(double diameter_m) { return std::numbers::pi / 4 * diameter_m * diameter_m; }

WorldConfig in_a_vessel(double mean_flow_m3_s) {
  WorldConfig config;
  config.vessel.emplace();
  config.vessel->pump.mean_flow_m3_s = mean_flow_m3_s;
  return config;
}

void drift(World& world, double seconds) {
  for (int k = 0; k < std::lround(seconds / kTickS); ++k) world.step(0);
}

// Boots 0.1 m into the large tube, which ends at 1.4 m.
TEST(Vessel, CarriesTheSameFlowRateInBothTubesAtEveryMoment) {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/flow_profile.json"));
  const double ratio = golden["tube"]["U_ratio_small_over_large"];
  VesselParameters parameters;
  parameters.pump.mean_flow_m3_s = kPaperFlowM3S;
  Vessel vessel{parameters};
  EXPECT_NEAR(ratio, kRatio, 1e-5);
  for (int k = 0; k < 1000; ++k) {
    vessel.step();
    const double large_m_s = vessel.velocity_m_s(0.5), small_m_s = vessel.velocity_m_s(2);
    ASSERT_NEAR(large_m_s * golden["tube"]["A_large"].get<double>(), vessel.pump().flow_m3_s(), 1e-15);
    ASSERT_NEAR(small_m_s * golden["tube"]["A_small"].get<double>(), vessel.pump().flow_m3_s(), 1e-15);
    ASSERT_NEAR(small_m_s / large_m_s, ratio, 1e-9);
    ASSERT_NEAR(vessel.velocity_m_s(-0.2) * area(0.25), vessel.pump().flow_m3_s(), 1e-15);
  }
}

TEST(Vessel, PassesFromOneVelocityToTheOtherOverTheRobotsLength) {
  VesselParameters parameters;
  parameters.pump = {.mean_flow_m3_s = kPaperFlowM3S, .compliance_s = 0};
  const Vessel vessel{parameters};
  const double large_m_s = vessel.velocity_m_s(1), small_m_s = vessel.velocity_m_s(2);
  EXPECT_NEAR(vessel.velocity_m_s(1.4 - 0.045), large_m_s, 1e-12);
  EXPECT_NEAR(vessel.velocity_m_s(1.4), (large_m_s + small_m_s) / 2, 1e-12);
  EXPECT_NEAR(vessel.velocity_m_s(1.4 + 0.045), small_m_s, 1e-12);
}

TEST(Vessel, MayBeginWithTheSmallTube) {
  VesselParameters parameters;
  parameters.is_large_tube_first = false;
  parameters.pump.mean_flow_m3_s = 0.001;
  const Vessel vessel{parameters};
  EXPECT_NEAR(vessel.velocity_m_s(0.5) / vessel.velocity_m_s(2), kRatio, 1e-4);
}

TEST(Vessel, KnowsTheTubeOfAPlace) {
  VesselParameters parameters;
  const Vessel vessel{parameters};
  for (const double in_large_m : {-0.2, 0.0, 1.39}) EXPECT_NEAR(vessel.tube_area_m2(in_large_m), area(0.16), 1e-12);
  for (const double in_small_m : {1.41, 2.0, 3.1}) EXPECT_NEAR(vessel.tube_area_m2(in_small_m), area(0.102), 1e-12);
  parameters.is_large_tube_first = false;
  EXPECT_NEAR(Vessel{parameters}.tube_area_m2(0), area(0.102), 1e-12);
}

TEST(Vessel, CarriesARobotAtRestByTheMeanFlow) {
  World world{in_a_vessel(kPaperFlowM3S)};
  drift(world, 6);  // 7 periods
  EXPECT_NEAR(world.position_m(), 6 * kPaperFlowM3S / area(0.16), 1e-5);
  drift(world, 6);
  EXPECT_NEAR(world.position_m(), 12 * kPaperFlowM3S / area(0.16), 2e-5);
}

TEST(Vessel, CarriesBackwardsWhenTheFlowIsReversed) {
  World forwards{in_a_vessel(kPaperFlowM3S)}, backwards{in_a_vessel(-kPaperFlowM3S)};
  drift(forwards, 1);
  drift(backwards, 1);
  EXPECT_NEAR(backwards.position_m(), -forwards.position_m(), 1e-12);
}

TEST(Vessel, ADriftingRobotTakesTheSpeedOfTheOtherTube) {
  WorldConfig config = in_a_vessel(kPaperFlowM3S);
  config.vessel->junction_m = 0.2;
  World world{config};
  drift(world, 12);
  ASSERT_GT(world.position_m(), 0.3);
  const double before_m = world.position_m();
  drift(world, 6);
  EXPECT_NEAR(world.position_m() - before_m, 6 * kPaperFlowM3S / area(0.102), 1e-4);
}

// What goes in comes out: the time through the junction is that of the volume between.
TEST(Vessel, TheRobotPassesAsMuchVolumeAsThePumpDrives) {
  WorldConfig config = in_a_vessel(kPaperFlowM3S);
  config.vessel->junction_m = 0.2;
  World world{config};
  double driven_m3 = 0;
  while (world.position_m() < 0.4) {
    const double before = world.flow_m3_s();
    world.step(0);
    driven_m3 += kTickS * (before + world.flow_m3_s()) / 2;
  }
  // Over its length the robot takes the mean of 1/A, so the volume is that of a smooth transition.
  const double step = 1 / area(0.102) - 1 / area(0.16);
  const double in_transition_m3 = 0.09 / step * std::log(area(0.16) / area(0.102));
  const double expected_m3 = (0.2 - 0.045) * area(0.16) + in_transition_m3 + (world.position_m() - 0.245) * area(0.102);
  EXPECT_NEAR(driven_m3, expected_m3, 2e-4 * expected_m3);
}

TEST(Vessel, TheAccelerometerFeelsOnlyTheFlowsChange) {
  WorldConfig config = in_a_vessel(kPaperFlowM3S);
  config.vessel->pump.compliance_s = 0;
  World world{config};
  double sum_m_s2 = 0;
  for (int k = 1; k <= 600; ++k) {
    const double before_m_s = world.flow_velocity_m_s();
    world.step(0);
    ASSERT_NEAR(world.acceleration_m_s2(), (world.flow_velocity_m_s() - before_m_s) / kTickS, 1e-9);
    sum_m_s2 += world.acceleration_m_s2();
  }
  EXPECT_NEAR(sum_m_s2, 0, 1e-9);  // nothing of the mean
  EXPECT_GT(world.velocity_m_s(), 0.01);
}

TEST(Vessel, FlowAndMotorAddUp) {
  World still{WorldConfig{}}, carried{in_a_vessel(kPaperFlowM3S)}, drifting{in_a_vessel(kPaperFlowM3S)};
  for (int k = 0; k < 600; ++k) {
    still.step(0.4);
    carried.step(0.4);
    drifting.step(0);
  }
  EXPECT_NEAR(carried.position_m(), still.position_m() + drifting.position_m(), 1e-9);
  EXPECT_NEAR(carried.velocity_m_s(), still.velocity_m_s() + drifting.velocity_m_s(), 1e-9);
}

TEST(Vessel, EndsInAWallThatStopsTheRobotAndLetsItGo) {
  World world{in_a_vessel(0)};
  for (int k = 0; k < 2000; ++k) world.step(-1);
  const double wall_m = 1.4 - 1.5 - 0.3 + 0.045;
  EXPECT_EQ(world.position_m(), wall_m);
  EXPECT_EQ(world.velocity_m_s(), 0);
  EXPECT_EQ(world.acceleration_m_s2(), 0);
  for (int k = 0; k < 200; ++k) world.step(1);
  EXPECT_GT(world.position_m(), wall_m + 0.1);
}

TEST(Vessel, TheWallIsFeltAsTheSpeedThatItTakes) {
  World world{in_a_vessel(0)};
  double felt_m_s = 0;
  for (int k = 0; k < 2000; ++k) {
    world.step(-1);
    felt_m_s += kTickS * world.acceleration_m_s2();
  }
  EXPECT_NEAR(felt_m_s, 0, 2e-3);
}

TEST(Vessel, RefusesWhatCannotBe) {
  VesselParameters outside;
  outside.junction_m = 5;
  EXPECT_THROW(check(outside), std::invalid_argument);
  EXPECT_THROW(check(VesselParameters{.small_diameter_m = 0.2}), std::invalid_argument);
  World world{WorldConfig{}};
  EXPECT_THROW(world.set_mean_flow_m3_s(0.001), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
