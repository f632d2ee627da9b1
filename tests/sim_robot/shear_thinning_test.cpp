// The fluid that thins under shear is no linear one: its speed grows faster than the duty, and it lags.
#include "sim_robot/world/shear_thinning_plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "sim_robot/world/world.hpp"

namespace sim_robot {
namespace {

double speed_at(double duty, const ShearThinningParameters& parameters = {}) {
  ShearThinningPlant plant{parameters, kTickS};
  for (int k = 0; k < 1000; ++k) plant.step(duty);
  EXPECT_NEAR(plant.acceleration_m_s2(), 0, 1e-9);
  return plant.velocity_m_s();
}

TEST(ShearThinningPlant, IsAsFastAsTheFabricSoftenerAtDuty06AndOfAnotherSpeedElsewhere) {
  EXPECT_NEAR(speed_at(0.6), 0.06, 1e-9);
  for (const double duty : {0.2, 0.8, 1.0}) EXPECT_NEAR(speed_at(duty), 0.06 * std::pow(duty / 0.6, 1 / 0.6), 1e-4);
}

TEST(ShearThinningPlant, IsLinearWellBelowTheSpeedOfItsRegularisationAndWithExponent1) {
  EXPECT_NEAR(speed_at(2e-3) / speed_at(1e-3), 2, 1e-3);
  EXPECT_NEAR(speed_at(1, {.exponent = 1}) / speed_at(0.1, {.exponent = 1}), 10, 1e-6);
}

// With its memory the drag comes late, and the speed goes beyond what it will be.
TEST(ShearThinningPlant, TheDragLags) {
  const auto highest = [](double relaxation_s) {
    ShearThinningPlant plant{{.relaxation_s = relaxation_s}, kTickS};
    double highest_m_s = 0;
    for (int k = 0; k < 500; ++k) plant.step(0.6), highest_m_s = std::max(highest_m_s, plant.velocity_m_s());
    return highest_m_s;
  };
  EXPECT_LT(highest(0.01), 0.0601);
  EXPECT_GT(highest(0.2), 0.066);
}

TEST(ShearThinningPlant, GoesBackwardsAsItGoesForwards) {
  ShearThinningPlant forwards{{}, kTickS}, backwards{{}, kTickS};
  for (int k = 0; k < 300; ++k) {
    forwards.step(std::sin(0.05 * k));
    backwards.step(-std::sin(0.05 * k));
    ASSERT_EQ(forwards.position_m(), -backwards.position_m());
  }
}

TEST(ShearThinningPlant, FourStepsATickAreEnough) {
  ShearThinningPlant plant{{}, kTickS}, fine{{}, kTickS, 400};
  for (int k = 0; k < 1000; ++k) {
    const double duty = k % 40 < 20 ? 1 : k % 3 == 0 ? -1 : 0;  // through rest, and stopping there
    plant.step(duty);
    fine.step(duty);
    ASSERT_NEAR(plant.velocity_m_s(), fine.velocity_m_s(), 2e-5) << k;
    ASSERT_NEAR(plant.position_m(), fine.position_m(), 2e-5) << k;
  }
}

// Near rest the drag is steepest: the integration must come to rest there and not swing on.
TEST(ShearThinningPlant, ComesToRest) {
  ShearThinningPlant plant{{}, kTickS};
  for (int k = 0; k < 1000; ++k) plant.step(k < 500 ? 1 : 0);
  EXPECT_LT(std::abs(plant.velocity_m_s()), 1e-9);
}

TEST(ShearThinningPlant, RefusesParametersThatCannotBe) {
  const auto refuses = [](const ShearThinningParameters& parameters) {
    EXPECT_THROW(check(parameters), std::invalid_argument);
    EXPECT_THROW(check(PlantParameters{.kind = PlantKind::shear_thinning, .shear_thinning = parameters}),
                 std::invalid_argument);
    EXPECT_THROW((ShearThinningPlant{parameters, kTickS}), std::invalid_argument);
  };
  refuses({.exponent = 0});
  refuses({.exponent = 1.5});
  refuses({.relaxation_s = 0});
  refuses({.linear_below_m_s = 0});
  refuses({.speed_at_0_6_m_s = std::nan("")});
}

TEST(ShearThinningPlant, ServesInTheWorldAsOneOfTheFluids) {
  WorldConfig config;
  config.plant = fluid("shear_thinning");
  World world{config};
  for (int k = 0; k < 500; ++k) world.step(0.6);
  EXPECT_NEAR(world.velocity_m_s(), 0.06, 1e-6);
}

}  // namespace
}  // namespace sim_robot
