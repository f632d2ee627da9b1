// The fluids move the robot as the golden responses say, through the whole world, and the nonlinear one as its
// equations.
#include "sim_robot/world/plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "control/responses/time_response.hpp"
#include "sim_robot/world/world.hpp"

namespace sim_robot {
namespace {

constexpr double kDuty = 0.3;

nlohmann::json golden(const std::string& name) {
  return nlohmann::json::parse(std::ifstream(std::string(TEST_DATA_DIR "/") + name));
}

// Steps a world through those golden times that are ticks.
void expect_golden(const std::string& fluid_name, const std::string& velocity_file, const std::string& position_file) {
  WorldConfig config;
  config.plant = fluid(fluid_name);
  World world{config};
  const auto velocity = golden(velocity_file), position = golden(position_file);
  int compared = 0;
  long ticks = 0;
  for (std::size_t i = 1; i < velocity["t"].size(); ++i) {
    const double time_s = velocity["t"][i];
    const long due = std::lround(time_s / kTickS);
    if (std::abs(time_s - kTickS * static_cast<double>(due)) > 1e-9) continue;
    for (; ticks < due; ++ticks) world.step(kDuty);
    const double velocity_m_s = velocity["velocity"][i], position_m = position["position"][i];
    EXPECT_NEAR(world.velocity_m_s(), velocity_m_s, 2e-6 * velocity_m_s) << time_s;
    EXPECT_NEAR(world.position_m(), position_m, 2e-6 * position_m) << time_s;
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST(Plant, TheFabricSoftenerFollowsTheGoldenStepOf29) {
  expect_golden("non_newtonian", "fo_step_velocity.json", "fo_step_position.json");
}

TEST(Plant, WaterFollowsTheGoldenStepOf28) { expect_golden("water", "io_step.json", "io_step.json"); }

TEST(Plant, ThereIsNoOtherFluid) {
  EXPECT_THROW(fluid("honey"), std::invalid_argument);
  EXPECT_THROW(fluid(""), std::invalid_argument);
}

TEST(Plant, RefusesAModelThatCannotBe) {
  EXPECT_THROW(check(PlantParameters{.model = {.kp = 0.1, .b3 = -1}}), std::invalid_argument);
  PlantParameters weightless{.kind = PlantKind::nonlinear};
  weightless.hydrodynamics.mass_kg = -10;
  EXPECT_THROW(check(weightless), std::invalid_argument);
}

// Thrust and drag in balance: 7.2924 N at duty 0.3, 9.858 v² + 1.9716 v.
TEST(NonlinearPlant, EndsWhereThrustEqualsDrag) {
  NonlinearPlant plant{{}, kTickS};
  for (int k = 0; k < 1000; ++k) plant.step(kDuty);
  const double quadratic = 9.858, linear = 1.9716, thrust_n = 7.2924;
  const double expected = (-linear + std::sqrt(linear * linear + 4 * quadratic * thrust_n)) / (2 * quadratic);
  EXPECT_NEAR(plant.velocity_m_s(), expected, 1e-4);
  EXPECT_NEAR(plant.velocity_m_s(), 0.77, 0.005);
  EXPECT_NEAR(plant.acceleration_m_s2(), 0, 1e-9);
}

TEST(NonlinearPlant, ThrustGrowsWithTheSquareOfTheDuty) {
  NonlinearPlant weak{{}, 1e-3, 1}, strong{{}, 1e-3, 1};
  for (int k = 0; k < 5; ++k) {  // before drag counts
    weak.step(0.1);
    strong.step(0.2);
  }
  EXPECT_NEAR(strong.velocity_m_s() / weak.velocity_m_s(), 4, 0.01);
}

TEST(NonlinearPlant, GoesBackwardsAsItGoesForwards) {
  NonlinearPlant forwards{{}, kTickS}, backwards{{}, kTickS};
  for (int k = 0; k < 300; ++k) {
    forwards.step(std::sin(0.05 * k));
    backwards.step(-std::sin(0.05 * k));
    ASSERT_EQ(forwards.position_m(), -backwards.position_m());
  }
}

TEST(NonlinearPlant, FourStepsATickAreEnough) {
  NonlinearPlant plant{{}, kTickS}, fine{{}, kTickS, 400};
  for (int k = 0; k < 1000; ++k) {
    const double duty = k % 40 < 20 ? 1 : -1;  // the hardest there is
    plant.step(duty);
    fine.step(duty);
    ASSERT_NEAR(plant.velocity_m_s(), fine.velocity_m_s(), 1e-5) << k;
    ASSERT_NEAR(plant.position_m(), fine.position_m(), 1e-5) << k;
  }
}

// Near a working point it is the linear model with D = 2 u0 X|u|u + Xu, in which (28) has its poles.
TEST(NonlinearPlant, HasThePolesOf28AtItsWorkingPoint) {
  const control::HydrodynamicModel linear = control::hydrodynamic_model({});
  const double rest_duty = std::sqrt((9.858 + 1.9716) / 7.2924) * kDuty;  // holds 1 m/s
  NonlinearPlant plant{{}, 1e-3};
  for (int k = 0; k < 20'000; ++k) plant.step(rest_duty);
  ASSERT_NEAR(plant.velocity_m_s(), 1, 1e-4);
  const double rest_m_s = plant.velocity_m_s();
  for (int k = 0; k < 10; ++k) plant.step(rest_duty * 1.001);
  for (int k = 0; k < 150; ++k) plant.step(rest_duty);  // the motor's lag is over
  const double first_m_s = plant.velocity_m_s() - rest_m_s;
  for (int k = 0; k < 100; ++k) plant.step(rest_duty);
  const double rate = std::log(first_m_s / (plant.velocity_m_s() - rest_m_s)) / 0.1;
  EXPECT_NEAR(rate, linear.damping_kg_s / linear.total_mass_kg, 0.2);
}

TEST(Plant, ADeadTimeIsTheSameMotionSoMuchLater) {
  for (const PlantKind kind : {PlantKind::linear, PlantKind::nonlinear, PlantKind::shear_thinning}) {
    Plant prompt{{.kind = kind}, kTickS}, late{{.kind = kind, .dead_time_s = 0.05}, kTickS};
    for (int k = 0; k < 5; ++k) late.step(kDuty);
    EXPECT_EQ(late.position_m(), 0);
    for (int k = 0; k < 200; ++k) {
      prompt.step(k < 100 ? kDuty : 0);
      late.step(k < 95 ? kDuty : 0);
      ASSERT_EQ(late.position_m(), prompt.position_m()) << k;
    }
  }
  EXPECT_THROW(check(PlantParameters{.dead_time_s = -0.01}), std::invalid_argument);
}

TEST(Plant, TheDeadTimeOfItsModelAddsToItsOwn) {
  PlantParameters both{.dead_time_s = 0.02};
  both.model.dead_time_s = 0.03;
  Plant plant{both, kTickS}, same{{.dead_time_s = 0.05}, kTickS};
  for (int k = 0; k < 100; ++k) {
    plant.step(kDuty);
    same.step(kDuty);
    ASSERT_EQ(plant.position_m(), same.position_m()) << k;
  }
  EXPECT_GT(plant.position_m(), 0);
  both.model.dead_time_s = 10;
  EXPECT_THROW(check(both), std::invalid_argument);
}

TEST(Plant, ADeadTimeThatEndsWithinATickIsExact) {
  control::FractionalModel model = control::kNonNewtonianModel;
  model.dead_time_s = 0.0537;
  Plant plant{{.dead_time_s = 0.0537}, kTickS};
  std::vector<double> time_s{0}, duty, position_m{0};
  for (int k = 0; k < 300; ++k) {
    duty.push_back(k % 40 < 20 ? 1 : -0.5);
    time_s.push_back(kTickS * (k + 1));
    plant.step(duty.back());
    position_m.push_back(plant.position_m());
  }
  duty.push_back(0);
  const auto expected = control::sampled_response(model, time_s, duty).position_m;
  for (std::size_t k = 0; k < position_m.size(); ++k) ASSERT_NEAR(position_m[k], expected[k], 1e-7) << k;
}

TEST(Plant, TheNonlinearOneRoundsADeadTimeToWholeTicks) {
  Plant plant{{.kind = PlantKind::nonlinear, .dead_time_s = 0.053}, kTickS};
  Plant rounded{{.kind = PlantKind::nonlinear, .dead_time_s = 0.05}, kTickS};
  for (int k = 0; k < 100; ++k) {
    plant.step(kDuty);
    rounded.step(kDuty);
    ASSERT_EQ(plant.position_m(), rounded.position_m()) << k;
  }
  EXPECT_GT(plant.position_m(), 0);
}

TEST(NonlinearPlant, ServesInTheWorldAsOneOfTheFluids) {
  WorldConfig config;
  config.plant = fluid("water_nonlinear");
  World world{config};
  for (int k = 0; k < 500; ++k) world.step(kDuty);
  EXPECT_NEAR(world.velocity_m_s(), 0.77, 0.005);
}

}  // namespace
}  // namespace sim_robot
