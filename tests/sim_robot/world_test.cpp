// The world as a whole: what it is by default, that a seed repeats it, and what it refuses.
#include "sim_robot/world/world.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "control/models/modal_plant.hpp"

namespace sim_robot {
namespace {

WorldConfig with_everything(std::uint64_t seed) {
  WorldConfig config;
  config.motor = {.dead_zone_duty = 0.03, .time_constant_s = 0.02};
  config.battery = kCr123a;
  config.vessel.emplace();
  config.vessel->pump.mean_flow_m3_s = kPaperFlowM3S;
  config.glucose.patches = {{.position_m = 0.3, .mixing_m2_s = 1e-5, .decay_s = 100}};
  config.imu.emplace();
  config.electrode = kDs550;
  config.seed = seed;
  return config;
}

TEST(World, IsTheModelAloneByDefaultToTheLastBit) {
  World world{WorldConfig{}};
  control::ModalPlant plant{control::kNonNewtonianModel, kTickS};
  for (int k = 0; k < 500; ++k) {
    const double duty = std::sin(0.1 * k);
    world.step(duty);
    plant.step(duty);
    ASSERT_EQ(world.position_m(), plant.position_m());
    ASSERT_EQ(world.velocity_m_s(), plant.velocity_m_s());
    ASSERT_EQ(world.acceleration_m_s2(), plant.acceleration_m_s2());
  }
  const robot_fw::Inputs inputs = world.read(5'000'000);
  EXPECT_EQ(inputs.robot_time_us, 5'000'000u);
  EXPECT_EQ(inputs.known_motion->position_m, static_cast<float>(plant.position_m()));
  EXPECT_EQ(inputs.impedance_mv, 175);
  EXPECT_EQ(inputs.supply_mv, 3000);
  EXPECT_EQ(world.flow_m3_s(), 0);
}

TEST(World, WithAnAccelerometerGivesTheCoreNoPosition) {
  World world{with_everything(1)};
  world.step(0.5);
  const robot_fw::Inputs inputs = world.read(0);
  EXPECT_FALSE(inputs.known_motion.has_value());
  EXPECT_NE(world.accelerometer_bias_m_s2(), 0);
}

// A robot that begins to move as t^1.45 gains more in the first tick than a straight line of acceleration says. The
// sensor's phase, up to a tick, is drawn by the seed.
TEST(World, ReadingsAddUpToTheVelocityHoweverSuddenlyItBegins) {
  constexpr int kSeeds = 20;
  double missing_m_s = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    WorldConfig config;
    config.plant.model.alpha = 1.45;
    config.plant.model.b1 /= 2;
    config.imu = ImuParameters{.noise_m_s2_rthz = 0,
                               .offset_m_s2 = 0,
                               .wander_m_s2 = 0,
                               .drift_m_s3 = 0,
                               .clock_error = 0,
                               .missed_read_probability = 0};
    config.seed = seed;
    World world{config};
    double sum_m_s2 = 0;
    for (int k = 0; k < 100; ++k) {
      world.step(1);
      sum_m_s2 += world.read(0).acceleration_counts / Imu::kCountsPerMS2;
    }
    missing_m_s += (world.velocity_m_s() - sum_m_s2 * kTickS) / kSeeds;
  }
  EXPECT_NEAR(missing_m_s, 0, 0.0025);  // between two samples something is lost
}

TEST(World, IsTheSameForTheSameSeedAndAnotherForAnother) {
  World one{with_everything(7)}, same{with_everything(7)}, other{with_everything(8)};
  int differences = 0;
  for (int k = 0; k < 500; ++k) {
    for (World* world : {&one, &same, &other}) world->step(0.4);
    const auto first = one.read(0), second = same.read(0), third = other.read(0);
    ASSERT_EQ(first.acceleration_counts, second.acceleration_counts);
    ASSERT_EQ(first.impedance_mv, second.impedance_mv);
    differences += first.acceleration_counts != third.acceleration_counts;
  }
  EXPECT_EQ(one.position_m(), other.position_m());  // the seed is the sensors'
  EXPECT_GT(differences, 100);
}

TEST(World, DrivesTenMinutesToTheWallOnAWeakerBattery) {
  World world{with_everything(1)};
  for (int k = 0; k < 60'000; ++k) world.step(0.5);
  EXPECT_TRUE(std::isfinite(world.position_m()));
  EXPECT_EQ(world.position_m(), world.vessel()->last_m());
  EXPECT_LT(world.supply_mv(), 3000);
}

TEST(World, RefusesWhatAPartRefusesAndSaysTheValue) {
  WorldConfig config;
  config.motor.dead_zone_duty = 2;
  try {
    check(config);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "motor: dead_zone_duty must be in [0, 1), is 2");
  }
  EXPECT_THROW(World{config}, std::invalid_argument);
  EXPECT_NO_THROW(check(with_everything(1)));
}

}  // namespace
}  // namespace sim_robot
