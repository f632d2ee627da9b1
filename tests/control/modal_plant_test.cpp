// The simulated motion agrees with the reference responses, at any step size.
#include "control/modal_plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace control {
namespace {

constexpr double kDuty = 0.3;

nlohmann::json golden(const std::string& name) {
  return nlohmann::json::parse(std::ifstream(std::string(TEST_DATA_DIR "/") + name));
}

// Steps a plant through the golden times and compares one channel.
template <class Channel>
void expect_golden(const FractionalModel& model, double dt_s, const nlohmann::json& reference, const char* key,
                   double relative, Channel channel) {
  ModalPlant plant{model, dt_s};
  const auto& times_s = reference["t"];
  const auto& values = reference[key];
  long steps = 0;
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    const long due = std::lround(times_s[i].get<double>() / dt_s);
    for (; steps < due; ++steps) plant.step(kDuty);
    const double expected = values[i];
    EXPECT_NEAR(channel(plant), expected, relative * expected) << key << " at " << times_s[i] << " s, dt " << dt_s;
  }
}

double position(const ModalPlant& plant) { return plant.position_m(); }
double velocity(const ModalPlant& plant) { return plant.velocity_m_s(); }

TEST(ModalPlant, FollowsModel29Within2e6AtAnyStepSize) {
  for (const double dt_s : {1e-3, 1e-2}) {
    expect_golden(kNonNewtonianModel, dt_s, golden("fo_step_velocity.json"), "velocity", 2e-6, velocity);
    expect_golden(kNonNewtonianModel, dt_s, golden("fo_step_position.json"), "position", 2e-6, position);
  }
}

TEST(ModalPlant, FollowsTheIntegerOrderModel28) {
  for (const double dt_s : {1e-3, 1e-2}) {
    expect_golden(kNewtonianModel, dt_s, golden("io_step.json"), "velocity", 1e-10, velocity);
    expect_golden(kNewtonianModel, dt_s, golden("io_step.json"), "position", 1e-10, position);
  }
}

TEST(ModalPlant, GivesTheSameMotionForOneStepOfTenMillisecondsAsForTenOfOne) {
  ModalPlant coarse{kNonNewtonianModel, 1e-2}, fine{kNonNewtonianModel, 1e-3};
  for (int i = 0; i < 500; ++i) {
    const double duty = std::sin(0.1 * i);
    coarse.step(duty);
    for (int j = 0; j < 10; ++j) fine.step(duty);
    ASSERT_NEAR(coarse.position_m(), fine.position_m(), 1e-13);
    ASSERT_NEAR(coarse.velocity_m_s(), fine.velocity_m_s(), 1e-13);
  }
}

TEST(ModalPlant, AccelerationIsTheSlopeOfTheVelocity) {
  constexpr double kFineS = 1e-5;
  ModalPlant plant{kNonNewtonianModel, kFineS};
  for (int i = 0; i < 5000; ++i) plant.step(kDuty);
  const double before = plant.velocity_m_s();
  plant.step(kDuty);
  const double acceleration = plant.acceleration_m_s2();
  plant.step(kDuty);
  EXPECT_NEAR(acceleration, (plant.velocity_m_s() - before) / (2 * kFineS), 1e-3 * std::abs(acceleration));
}

TEST(ModalPlant, ApproachesItsGainForOtherOrdersToo) {
  for (const double alpha : {1.2, 1.5, 1.9}) {
    for (const double beta : {0.5, 0.8, 0.95}) {
      FractionalModel model = kNonNewtonianModel;
      model.alpha = alpha;
      model.beta = beta;
      ModalPlant plant{model, 0.01};
      for (int i = 0; i < 60'000; ++i) plant.step(1);
      const double creep = model.kp * model.b2 / (std::pow(600, beta) * std::tgamma(1 - beta));
      EXPECT_NEAR(plant.velocity_m_s(), model.kp - creep, 0.02 * creep + 1e-6) << alpha << " " << beta;
    }
  }
}

TEST(ModalPlant, StartsAgainFromRestAfterReset) {
  ModalPlant plant{kNonNewtonianModel, 0.01};
  plant.step(1);
  const double moved_m = plant.position_m();
  plant.reset();
  EXPECT_EQ(plant.position_m(), 0);
  plant.step(1);
  EXPECT_EQ(plant.position_m(), moved_m);
}

TEST(ModalPlant, RefusesModelsOutsideItsRange) {
  const auto with = [](auto change) {
    FractionalModel model;
    change(model);
    return model;
  };
  EXPECT_THROW(ModalPlant(with([](auto& m) { m.alpha = 2.1; }), 0.01), std::invalid_argument);
  EXPECT_THROW(ModalPlant(with([](auto& m) { m.beta = 1.0; }), 0.01), std::invalid_argument);
  EXPECT_THROW(ModalPlant(with([](auto& m) { m.b1 = 0; }), 0.01), std::invalid_argument);
  EXPECT_THROW(ModalPlant(with([](auto& m) { m.b2 = std::nan(""); }), 0.01), std::invalid_argument);
  EXPECT_THROW(ModalPlant(kNonNewtonianModel, 0), std::invalid_argument);
}

}  // namespace
}  // namespace control
