// Which plants four sections can follow, how well, and what is said of those that they cannot.
#include "control/discretisation/estimator_model.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "control/responses/time_response.hpp"
#include "tests/control/fluid_family.hpp"

namespace control {
namespace {

using ::testing::HasSubstr;

double steady_gain_m_s(const EstimatorSections& sections) {
  return std::accumulate(sections.gain_m_s.begin(), sections.gain_m_s.end(), 0.0);
}

// (1) with true exponentials and in double, at other times than those that are fitted, most of them between ticks.
double largest_error(const EstimatorSections& sections, const FractionalModel& plant) {
  std::vector<double> time_s;
  for (double t_s = 0.01; t_s < 60; t_s *= 1.003) time_s.push_back(t_s);
  const auto response = step_response(plant, 1, time_s).velocity_m_s;
  double largest_m_s = 0;
  for (std::size_t n = 0; n < time_s.size(); ++n) {
    double velocity_m_s = 0;
    for (std::size_t i = 0; i < kEstimatorSections; ++i) {
      const double left = std::exp(-time_s[n] / static_cast<double>(sections.time_constant_s[i]));
      velocity_m_s += static_cast<double>(sections.gain_m_s[i]) * (1 - left);
    }
    largest_m_s = std::max(largest_m_s, std::abs(velocity_m_s - response[n]));
  }
  return largest_m_s * plant.b3 / std::abs(plant.kp);
}

TEST(EstimatorModel, FollowsTheFluidOfThePaper) {
  const EstimatorModel model = estimator_model(kNonNewtonianModel);
  EXPECT_TRUE(model.is_met);
  EXPECT_LE(model.fit_error, 0.0017);
  EXPECT_NEAR(largest_error(model.sections, kNonNewtonianModel), model.fit_error, 2e-4);
  EXPECT_NEAR(steady_gain_m_s(model.sections), 0.1, 0.001);
  EXPECT_EQ(model.reason, "");
}

TEST(EstimatorModel, IsExactForIntegerOrdersWithNoMoreSectionsThanPoles) {
  const EstimatorModel water = estimator_model(kNewtonianModel);
  EXPECT_LE(water.fit_error, 2e-5);
  EXPECT_EQ(std::ranges::count(water.sections.gain_m_s, 0.0F), 2);
  const FractionalModel lag{-3, 0, 0.5, 1, 2, 1};
  const EstimatorModel first_order = estimator_model(lag);
  EXPECT_LE(first_order.fit_error, 2e-5);
  EXPECT_NEAR(first_order.sections.gain_m_s[0], -3, 1e-4);
  EXPECT_NEAR(first_order.sections.time_constant_s[0], 0.5, 1e-4);
}

TEST(EstimatorModel, RefusesADeadTimeThatSectionsCannotFollow) {
  FractionalModel late = kNonNewtonianModel;
  late.dead_time_s = 0.07;
  const EstimatorModel model = estimator_model(late);
  EXPECT_FALSE(model.is_met);
  EXPECT_NE(model.reason.find("dead time"), std::string::npos) << model.reason;
}

TEST(EstimatorModel, WhatIsMetIsMetAtOtherTimesTooAndInFloat32) {
  int met = 0;
  for (const FractionalModel& fluid : fluid_family(8, 7)) {
    const EstimatorModel model = estimator_model(fluid);
    EXPECT_EQ(model.is_met, model.fit_error <= kLargestFitError);
    EXPECT_EQ(model.is_met, model.reason.empty());
    EXPECT_EQ(fit_error(model.sections, fluid), model.fit_error);
    EXPECT_NEAR(largest_error(model.sections, fluid), model.fit_error, 1e-3);
    for (const float gain_m_s : model.sections.gain_m_s) EXPECT_LE(std::abs(gain_m_s), 1.0001F);  // 10 v_∞
    if (!model.is_met) continue;
    ++met;
    EXPECT_NEAR(steady_gain_m_s(model.sections), fluid.kp, 0.01 * fluid.kp);
  }
  EXPECT_GE(met, 5);
}

// (2) at any time, in double, on a grid fifty times as dense as the one that the stated error is searched on.
double densely_largest_error(const EstimatorSections& sections, const FractionalModel& plant) {
  std::vector<double> time_s{60};
  for (double t_s = 0.01; t_s < 60; t_s *= 1.0002) time_s.push_back(t_s);
  const auto response = step_response(plant, plant.b3 / plant.kp, time_s).velocity_m_s;
  double largest = 0;
  for (std::size_t n = 0; n < time_s.size(); ++n) {
    double velocity_m_s = 0;
    for (std::size_t i = 0; i < kEstimatorSections; ++i) {
      const double x = 0.01 / static_cast<double>(sections.time_constant_s[i]);
      const double left = std::pow(1 - 12 * x / (12 + 6 * x + x * x), time_s[n] / 0.01);
      velocity_m_s += static_cast<double>(sections.gain_m_s[i]) * (1 - left);
    }
    largest = std::max(largest, std::abs(velocity_m_s * plant.b3 / plant.kp - response[n]));
  }
  return largest;
}

TEST(EstimatorModel, StatesTheTrueErrorOfItsWholeInterval) {
  for (const FractionalModel& fluid : fluid_family(35, 35)) {
    const EstimatorModel model = estimator_model(fluid);
    EXPECT_NEAR(model.fit_error, densely_largest_error(model.sections, fluid), 1e-5) << fluid.alpha;
    EXPECT_EQ(model.is_met, model.fit_error <= kLargestFitError);
  }
}

TEST(EstimatorModel, RefusesAPlantThatSwingsAndSaysHowNearItComes) {
  FractionalModel swinging = kNonNewtonianModel;
  swinging.alpha = 1.95;
  swinging.b2 /= 2;
  const EstimatorModel model = estimator_model(swinging);
  EXPECT_FALSE(model.is_met);
  EXPECT_GT(model.fit_error, 0.02);
  EXPECT_THAT(model.reason, HasSubstr("the robot needs 0.5 %; the plant overshoots by"));
}

TEST(EstimatorModel, RefusesAGainThatTheRobotsParametersCannotHold) {
  FractionalModel fast = kNewtonianModel;
  fast.kp *= 20;
  const EstimatorModel bounded = estimator_model(fast);
  EXPECT_TRUE(bounded.is_met);
  for (const float gain_m_s : bounded.sections.gain_m_s) EXPECT_LE(std::abs(gain_m_s), 10);
  fast.kp = 50 * fast.b3;
  EXPECT_THAT(estimator_model(fast).reason, HasSubstr("final velocity is 50 m/s"));
  FractionalModel undetermined = kNonNewtonianModel;  // as of a fit that has found an integrator
  for (double* parameter : {&undetermined.kp, &undetermined.b1, &undetermined.b2}) *parameter *= 1e20;
  EXPECT_FALSE(estimator_model(undetermined).is_met);
  EXPECT_THAT(estimator_model(undetermined).reason, HasSubstr("final velocity is"));
}

TEST(EstimatorModel, RefusesWhatIsNoPlant) {
  FractionalModel wrong = kNonNewtonianModel;
  wrong.b2 = -1;
  EXPECT_THROW(estimator_model(wrong), std::invalid_argument);
  EXPECT_THROW(fit_error({}, wrong), std::invalid_argument);
}

}  // namespace
}  // namespace control
