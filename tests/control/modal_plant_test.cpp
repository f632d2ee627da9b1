// The simulated motion agrees with the reference responses, at any step size.
#include "control/models/modal_plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "control/responses/time_response.hpp"
#include "model_samples.hpp"

namespace control {
namespace {

constexpr double kDuty = 0.3;

nlohmann::json golden_response(const std::string& name) {
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
    expect_golden(kNonNewtonianModel, dt_s, golden_response("fo_step_velocity.json"), "velocity", 2e-6, velocity);
    expect_golden(kNonNewtonianModel, dt_s, golden_response("fo_step_position.json"), "position", 2e-6, position);
  }
}

TEST(ModalPlant, FollowsTheIntegerModel28Within2e6AtAnyStepSize) {
  for (const double dt_s : {1e-3, 1e-2}) {
    expect_golden(kNewtonianModel, dt_s, golden_response("io_step.json"), "velocity", 2e-6, velocity);
    expect_golden(kNewtonianModel, dt_s, golden_response("io_step.json"), "position", 2e-6, position);
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

// Ten milliseconds is the first time that is promised, and none of the references has it.
TEST(ModalPlant, FollowsTheStepResponseFrom10MillisecondsOn) {
  std::vector<double> time_s;
  for (int k = 10; k <= 200; ++k) time_s.push_back(1e-3 * k);
  for (const FractionalModel& model : {kNonNewtonianModel, kNewtonianModel}) {
    const TimeResponse expected = step_response(model, kDuty, time_s);
    ModalPlant plant{model, 1e-3};
    for (int k = 1; k < 10; ++k) plant.step(kDuty);
    for (std::size_t k = 0; k < time_s.size(); ++k) {
      plant.step(kDuty);
      EXPECT_NEAR(plant.velocity_m_s(), expected.velocity_m_s[k], 2e-6 * expected.velocity_m_s[k]) << time_s[k];
      EXPECT_NEAR(plant.position_m(), expected.position_m[k], 2e-6 * expected.position_m[k]) << time_s[k];
    }
  }
}

TEST(ModalPlant, IsStillRightAfterADay) {
  constexpr double kDayS = 86'400;
  const double day[] = {kDayS};
  for (const FractionalModel& model : {kNonNewtonianModel, kNewtonianModel}) {
    const TimeResponse expected = step_response(model, kDuty, day);
    for (const double dt_s : {0.5, 10.0}) {
      ModalPlant plant{model, dt_s};
      for (long i = 0; i < std::lround(kDayS / dt_s); ++i) plant.step(kDuty);
      EXPECT_NEAR(plant.velocity_m_s(), expected.velocity_m_s[0], 5e-7 * expected.velocity_m_s[0]) << dt_s;
      EXPECT_NEAR(plant.position_m(), expected.position_m[0], 5e-7 * expected.position_m[0]) << dt_s;
    }
  }
}

TEST(ModalPlant, ComesBackToWhereItStartedAfterADayOfBackAndForth) {
  ModalPlant plant{kNonNewtonianModel, 0.5};
  for (int i = 0; i < 86'400; ++i) plant.step(i < 43'200 ? 1 : -1);
  const double time_s[] = {0, 21'600, 43'200}, duty[] = {1, -1, 0};
  EXPECT_NEAR(plant.position_m(), sampled_response(kNonNewtonianModel, time_s, duty).position_m[2], 2e-6 * 2160);
}

// Whatever the model, the duty and the step size; errors are counted against the largest motion so far, or against what
// modal_plant.hpp allows to rounding.
TEST(ModalPlant, FollowsModelsFromTheWholeRangeThroughChangingDuty) {
  for (const double dt_s : {1e-3, 1e-2, 0.7}) {
    std::vector<double> time_s, duty;
    for (int k = 0; k <= 300; ++k) {
      time_s.push_back(dt_s * k);
      duty.push_back(k < 50 ? 1 : std::sin(0.001 * k * k));
    }
    for (const FractionalModel& model : sample_models(21, 40)) {
      const TimeResponse expected = sampled_response(model, time_s, duty);
      ModalPlant plant{model, dt_s};
      double fastest_m_s = 0, farthest_m = 0;
      for (std::size_t k = 1; k < time_s.size(); ++k) {
        plant.step(duty[k - 1]);
        fastest_m_s = std::max(fastest_m_s, std::abs(expected.velocity_m_s[k]));
        farthest_m = std::max(farthest_m, std::abs(expected.position_m[k]));
        if (time_s[k] < 0.01) continue;
        const double rounding_m_s = 1e-14 * std::abs(model.kp / model.b3), rounding_m = rounding_m_s * time_s[k];
        ASSERT_NEAR(plant.velocity_m_s(), expected.velocity_m_s[k], 2e-6 * fastest_m_s + rounding_m_s)
            << model.alpha << " " << dt_s;
        ASSERT_NEAR(plant.position_m(), expected.position_m[k], 2e-6 * farthest_m + rounding_m)
            << model.alpha << " " << dt_s;
      }
    }
  }
}

TEST(ModalPlant, MovesTheSameForHalfTheStepSizeWhateverTheModel) {
  for (const FractionalModel& model : sample_models(22, 40)) {
    ModalPlant coarse{model, 0.04}, fine{model, 0.02};
    for (int i = 0; i < 100; ++i) {
      const double duty = std::cos(0.3 * i);
      coarse.step(duty);
      fine.step(duty);
      fine.step(duty);
      const double gain = std::abs(model.kp / model.b3);
      ASSERT_NEAR(coarse.velocity_m_s(), fine.velocity_m_s(), 1e-12 * gain) << i;
      ASSERT_NEAR(coarse.position_m(), fine.position_m(), 1e-12 * gain) << i;
    }
  }
}

TEST(ModalPlant, AnswersAtOnceWhereTheModelIsMuchFasterThanTheStep) {
  const FractionalModel model{2, 0, 1e-9, 1, 2, 1};  // a lag of 1 ns
  ModalPlant plant{model, 0.1};
  plant.step(0.5);
  EXPECT_NEAR(plant.velocity_m_s(), 1, 1e-6);
  EXPECT_NEAR(plant.position_m(), 0.1, 1e-7);
  EXPECT_NEAR(plant.acceleration_m_s2(), 0, 1e-5);
  plant.step(-0.5);
  EXPECT_NEAR(plant.velocity_m_s(), -1, 1e-6);
  EXPECT_NEAR(plant.position_m(), 0, 1e-7);
}

// With b2 this small the response is that of b1 s^α + b3 for hours: 1 - cos for α = 2.
TEST(ModalPlant, FollowsModelsWithHardlyAnyDamping) {
  for (const double alpha : {2.0, 1.9, 1.5}) {
    for (const double beta : {1.0, 0.5, 0.02}) {
      ModalPlant reference{{0.1, 0.1, 1e-8, 1, alpha, beta}, 0.01};
      std::vector<ModalPlant> plants;
      for (const double b2 : {1e-10, 1e-12, 1e-14, 1e-100}) {
        plants.emplace_back(FractionalModel{0.1, 0.1, b2, 1, alpha, beta}, 0.01);
      }
      for (int k = 1; k <= 1000; ++k) {
        reference.step(1);
        const double undamped_m_s = 0.1 * (1 - std::cos(0.01 * k / std::sqrt(0.1)));
        for (ModalPlant& plant : plants) {
          plant.step(1);
          ASSERT_NEAR(plant.velocity_m_s(), reference.velocity_m_s(), 1e-7) << alpha << " " << beta << " " << k;
          ASSERT_NEAR(plant.position_m(), reference.position_m(), 1e-6) << alpha << " " << beta << " " << k;
          if (alpha == 2) ASSERT_NEAR(plant.velocity_m_s(), undamped_m_s, 1e-8) << beta << " " << k;
        }
      }
    }
  }
}

TEST(ModalPlant, QuotesTheModelsAndStepSizesItRefuses) {
  const auto message = [](const FractionalModel& model, double dt_s) -> std::string {
    try {
      const ModalPlant plant{model, dt_s};
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message({1, 1, 1, 1, 2.1, 1}, 0.01), "model: alpha must lie in (beta, 2], is 2.1");
  EXPECT_EQ(message({1, 1, 1, 1, 2, 0}, 0.01), "model: beta must lie in (0, 1], is 0");
  EXPECT_EQ(message({1, 1, std::nan(""), 1, 2, 1}, 0.01), "model: b2 must be positive, is nan");
  EXPECT_EQ(message(kNonNewtonianModel, 0), "modal plant: dt_s must be positive and finite, is 0");
  EXPECT_EQ(message(kNonNewtonianModel, INFINITY), "modal plant: dt_s must be positive and finite, is inf");
  EXPECT_EQ(message({1, 0, 1, 1, 2, 1}, 0.01), "accepted");
}

}  // namespace
}  // namespace control
