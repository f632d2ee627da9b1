// The ideal closed loop agrees with the reference inversions.
#include "control/responses/continuous_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <string>

#include "control/models/plant_models.hpp"
#include "control/responses/polynomial_roots.hpp"
#include "model_samples.hpp"

namespace control {
namespace {

constexpr double kSetpointM = 0.1, kRelative = 1e-9;

TEST(ContinuousLoop, FollowsTheReferenceResponses) {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/closed_loop_cases.json"));
  for (const auto& row : golden["linear_continuous"]) {
    SCOPED_TRACE(row["plant"].get<std::string>());
    const bool is_fractional = row["plant"] == "Eq(29)";
    const ContinuousLoop loop{is_fractional ? kNonNewtonianModel : kNewtonianModel, kPaperController};
    for (std::size_t i = 0; i < row["t"].size(); ++i) {
      const double expected = row["y"][i];
      if (!is_fractional && row["t"][i] > 1.65) {  // the reference is off here: see the header
        ASSERT_NEAR(kSetpointM * loop.position(row["t"][i]), expected, 2e-5 * expected) << row["t"][i];
        continue;
      }
      ASSERT_NEAR(kSetpointM * loop.position(row["t"][i]), expected, kRelative * expected) << row["t"][i];
    }
    const ContinuousStep step = measure_continuous_step(loop);
    EXPECT_NEAR(kSetpointM * step.peak, row["peak"], kRelative * kSetpointM);
    EXPECT_NEAR(step.peak_time_s, row["peak_time_s"], 1e-7);
    EXPECT_NEAR(step.overshoot_percent, row["overshoot_pct"], 1e-6);
    ASSERT_TRUE(step.settling_2_percent_s.has_value());
    EXPECT_NEAR(*step.settling_2_percent_s, row["settling_2pct_s"], 1e-8);
  }
}

TEST(ContinuousLoop, DoesNotDependOnTheRay) {
  for (const auto& plant : {kNonNewtonianModel, kNewtonianModel}) {
    const ContinuousLoop middle{plant, kPaperController}, aside{plant, kPaperController, 0.3};
    for (const double t : {0.02, 0.2, 1.0, 1.7, 2.0, 2.5, 4.0, 20.0}) {
      EXPECT_NEAR(middle.position(t), aside.position(t), 1e-12) << t;
    }
  }
}

TEST(ContinuousLoop, IsTheExponentialOfAFirstOrderLoop) {
  // Q = s (b2 s + b3) + K kp with b1 = 0, beta = 1: s² + 2 s + 1.
  const FractionalModel plant{1, 0, 1, 2, 2, 1};
  const ContinuousLoop loop{plant, {1, 0, 0.5}};
  for (const double t : {0.01, 0.1, 1.0, 5.0, 30.0}) {
    const double exact = 1 - (1 + t) * std::exp(-t);
    EXPECT_NEAR(loop.position(t), exact, 1e-11) << t;
    EXPECT_NEAR(loop.velocity(t), t * std::exp(-t), 1e-9) << t;
  }
  EXPECT_EQ(measure_continuous_step(loop).overshoot_percent, 0);
}

TEST(ContinuousLoop, SaysThatALoopIsUnstable) {
  // s³ + s² + s + kp is stable for kp < 1.
  const FractionalModel plant{1, 1, 1, 1, 2, 1};
  EXPECT_NO_THROW(ContinuousLoop(plant, {0.9, 0, 0.5}));
  EXPECT_THROW(ContinuousLoop(plant, {1.1, 0, 0.5}), std::invalid_argument);
  EXPECT_FALSE(measure_continuous_step(ContinuousLoop(plant, {0.9, 0, 0.5})).settling_2_percent_s.has_value());
}

// Of (28) with kd = 0: s³ + 60.13 s² + 667.1 s + 232 kp; its step response by partial fractions.
double partial_fractions(double kp, double time_s) {
  const std::vector<double> q{1, 60.13, 667.1, 232 * kp};
  Complex sum = 1;
  for (const Complex p : polynomial_roots(q)) {
    const Complex plant = (p + 60.13) * p + 667.1, slope = (3.0 * p + 2 * 60.13) * p + 667.1;
    sum -= plant / slope * std::exp(p * time_s);
  }
  return sum.real();
}

TEST(ContinuousLoop, FollowsLightlyDampedLoops) {
  const double limit = 60.13 * 667.1 / 232;
  for (const double share : {0.001, 0.02, 0.05, 0.5, 0.9, 0.97, 0.999, 0.999999}) {
    SCOPED_TRACE(share);
    const FopdController controller{share * limit, 0, 0.5};
    const ContinuousLoop loop{kNewtonianModel, controller}, aside{kNewtonianModel, controller, 0.35};
    for (const double t : {1e-6, 1e-3, 0.02, 0.1, 0.35, 1.0, 3.0, 20.0, 300.0}) {
      const double exact = partial_fractions(controller.kp, t);
      EXPECT_NEAR(loop.position(t), exact, 1e-9) << t;
      EXPECT_NEAR(aside.position(t), exact, 1e-9) << t;
    }
  }
  EXPECT_THROW(ContinuousLoop(kNewtonianModel, {1.000001 * limit, 0, 0.5}), std::invalid_argument);
  EXPECT_THROW(ContinuousLoop(kNewtonianModel, {1.01 * limit, 0, 0.5}), std::invalid_argument);
  EXPECT_THROW(ContinuousLoop(kNewtonianModel, {1000 * limit, 0, 0.5}), std::invalid_argument);
}

TEST(ContinuousLoop, BeginsAtRestAndHasNoPast) {
  for (const auto& plant : {kNonNewtonianModel, kNewtonianModel}) {
    const ContinuousLoop loop{plant, kPaperController};
    EXPECT_EQ(loop.position(0), 0);
    EXPECT_NEAR(loop.position(1e-9), 0, 1e-9);
    EXPECT_THROW(loop.position(-1), std::invalid_argument);
    EXPECT_THROW(loop.position(std::nan("")), std::invalid_argument);
    EXPECT_THROW(loop.velocity(0), std::invalid_argument);
    EXPECT_THROW(measure_continuous_step(loop, 0), std::invalid_argument);
  }
}

// Time in other units: s → s/scale.
TEST(ContinuousLoop, HasNoTimeScaleOfItsOwn) {
  const FractionalModel plant = kNonNewtonianModel;
  const FopdController controller = kPaperController;
  const ContinuousLoop loop{plant, controller};
  const ContinuousStep step = measure_continuous_step(loop, 2);
  for (const double scale : {1e-6, 1e-3, 1e4}) {
    const FractionalModel other{plant.kp,
                                plant.b1 * std::pow(scale, plant.alpha),
                                plant.b2 * std::pow(scale, plant.beta),
                                plant.b3,
                                plant.alpha,
                                plant.beta};
    const ContinuousLoop slower{other,
                                {controller.kp / scale, controller.kd * std::pow(scale, controller.mu), controller.mu}};
    for (const double t : {1e-4, 0.01, 0.1, 1.0, 10.0}) {
      EXPECT_NEAR(slower.position(t * scale), loop.position(t), 1e-12) << t;
    }
    const ContinuousStep scaled = measure_continuous_step(slower, 2 * scale);
    EXPECT_NEAR(scaled.overshoot_percent, step.overshoot_percent, 1e-9);
    EXPECT_NEAR(*scaled.settling_2_percent_s, scale * *step.settling_2_percent_s, 1e-9 * scale);
  }
}

TEST(ContinuousLoop, AnswersOrRefusesRandomLoopsTheSameOnEveryRay) {
  std::mt19937 random{5};
  std::uniform_real_distribution<double> log_kp(-4, 8), log_kd(-6, 1), mu(0.05, 1.95);
  int stable = 0;
  for (const FractionalModel& model : sample_models(3, 40)) {
    const FractionalModel plant{std::abs(model.kp), model.b1, model.b2, model.b3, model.alpha, model.beta};
    const FopdController controller{std::exp(log_kp(random)), std::exp(log_kd(random)), mu(random)};
    if (controller.mu > (plant.b1 > 0 ? plant.alpha : plant.beta) + 0.75) continue;
    SCOPED_TRACE(testing::Message() << plant.kp << " " << plant.b1 << " " << plant.b2 << " " << plant.b3 << " "
                                    << plant.alpha << " " << plant.beta << ", " << controller.kp << " " << controller.kd
                                    << " " << controller.mu);
    try {
      const ContinuousLoop loop{plant, controller}, aside{plant, controller, 0.4};
      for (const double t : {0.01, 0.3, 1.0, 10.0, 1e3}) {
        const double time_s = t / loop.rate_rad_s();
        EXPECT_NEAR(loop.position(time_s), aside.position(time_s), 1e-9) << t;
      }
      EXPECT_NEAR(loop.position(1e-9 / loop.rate_rad_s()), 0, 0.2);
      ++stable;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("take a lower kp"), std::string::npos) << error.what();
    }
  }
  EXPECT_GT(stable, 15);
}

}  // namespace
}  // namespace control
