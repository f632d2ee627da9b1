// Plants and specifications at the edge of the numbers: each has an answer in words or in finite numbers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <vector>

#include "control/tuning/tune.hpp"
#include "control/tuning/tuning_alternatives.hpp"

namespace control {
namespace {

using testing::HasSubstr;

constexpr FractionalModel kNearlyAGain{26, 0, 0.0113, 1, 2e-9, 1e-9};  // its phase hardly falls, at any frequency

void expect_finite(const TunedController& design) {
  const auto& [kp, kd, mu] = design.controller;
  EXPECT_TRUE(std::isnormal(kp) && kp > 0) << kp;
  EXPECT_TRUE(std::isfinite(kd) && kd >= 0) << kd;
  EXPECT_LE(kd * std::pow(design.spec.gain_crossover_rad_s, mu), 1.0001e9);
  for (const Margins* margins : {&design.achieved, &design.sampled}) {
    EXPECT_TRUE(std::isfinite(margins->phase_margin_deg.value_or(0)));
    EXPECT_TRUE(std::isfinite(margins->phase_slope_deg_per_rad_s.value_or(0)));
    EXPECT_FALSE(std::isnan(margins->ms) || std::isnan(margins->mt));
  }
}

void expect_can_be_asked(const TunedController& design) {
  const auto& [omega_rad_s, margin_deg, mu, is_velocity_loop, period_s] = design.spec;
  EXPECT_TRUE(omega_rad_s >= 0.999999e-3 && omega_rad_s <= 1.000001e4) << omega_rad_s;
  EXPECT_TRUE(margin_deg >= 0.1 && margin_deg <= 179.9) << margin_deg;
  EXPECT_TRUE(!mu || (*mu >= 0.01 && *mu <= 1.99)) << *mu;
}

// A controller, or a reason; never an error from inside.
void expect_answer(const FractionalModel& plant, const TuningSpec& spec) {
  SCOPED_TRACE(testing::Message() << "kp " << plant.kp << ", b " << plant.b1 << ' ' << plant.b2 << ' ' << plant.b3
                                  << ", alpha " << plant.alpha << ", beta " << plant.beta << ", "
                                  << spec.gain_crossover_rad_s << " rad/s, " << spec.phase_margin_deg << " degrees, mu "
                                  << spec.mu.value_or(0) << (spec.is_velocity_loop ? ", velocity" : ""));
  TuningResult result;
  std::vector<PhaseMarginRange> ranges;
  ASSERT_NO_THROW(result = tune(plant, spec));
  ASSERT_NO_THROW(ranges = sound_phase_margins(plant, spec));
  for (const PhaseMarginRange& range : ranges) EXPECT_LE(range.low_deg, range.high_deg);
  EXPECT_EQ(result.is_feasible, result.tuned.has_value());
  EXPECT_EQ(result.is_feasible, result.reason.empty());
  EXPECT_THAT(result.reason, testing::Not(testing::AnyOf(HasSubstr("nan"), HasSubstr("inf"))));
  EXPECT_TRUE(std::isfinite(result.theta_deg) && std::isfinite(result.phase_fall));
  for (const auto* one : {&result.tuned, &result.refused}) {
    if (*one) expect_finite(**one);
  }
  for (const auto* list : {&result.nearest, &result.relaxed}) {
    for (const TunedController& design : *list) {
      expect_finite(design);
      expect_can_be_asked(design);
    }
  }
}

TEST(TuneExtremes, OrdersNearZeroAreRefusedInWords) {
  const TuningResult result = tune(kNearlyAGain, {100, 91});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_THAT(result.reason, HasSubstr("kd omega^mu would be above 1e+09"));
  EXPECT_THAT(result.reason, HasSubstr("ask with a fixed mu above"));
  for (const double beta : {1e-6, 1e-9, 1e-12, 1e-15, 1e-300}) {
    for (const double margin_deg : {89.9, 90.0, 90 + 1e-9, 90.0001, 91.0, 179.9}) {
      expect_answer({26, 0, 0.0113, 1, 2, beta}, {100, margin_deg});
      expect_answer({2.4e-37, 1.7e32, 1.5e23, 1, beta + 1e-9, beta}, {5, margin_deg, 0.9});
    }
  }
}

TEST(TuneExtremes, AMarginThatTakesAllOfAFixedMuIsRefusedInWords) {
  const FractionalModel plant{0.075, 0.28, 4063, 26, 2e-15, 1e-15};
  const TuningResult result = tune(plant, {5, 99 - 1e-10, 0.1});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_THAT(result.reason, HasSubstr("kd omega^mu would be above 1e+09"));
  EXPECT_THAT(result.reason, HasSubstr("ask for a larger mu or a smaller phase margin"));
}

TEST(TuneExtremes, AGainThatNoControllerMeetsIsRefusedInWords) {
  FractionalModel weak = kNonNewtonianModel;
  weak.kp = 1e-309;
  const TuningResult result = tune(weak, {10, 120, 0.9});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_THAT(result.reason, HasSubstr("no normal number of double precision; check the plant's units"));
  const FractionalModel overflowing{1, 1e200, 1e199, 1e198, 1.7, 0.9};
  try {
    tune(overflowing, {5, 91});
    ADD_FAILURE() << "tuned";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("overflows double precision with b1 = 1e+200"));
  }
}

// The fluid of the paper, ten thousand times slower: its iso-damped designs end at 6.8e-4 rad/s and begin at 5.8e-3.
TEST(TuneExtremes, WhatIsOfferedCanBeAskedFor) {
  FractionalModel slow = kNonNewtonianModel;
  slow.b1 *= std::pow(1e4, slow.alpha);
  slow.b2 *= std::pow(1e4, slow.beta);
  const TuningResult result = tune(slow, {2e-3, 95});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_FALSE(result.nearest.empty());
  for (const TunedController& design : result.nearest) expect_can_be_asked(design);
}

TEST(TuneExtremes, AControllerThatIsNearlyAllDerivativeSaysSo) {
  const TuningResult result = tune(kNonNewtonianModel, {0.01, 120});
  ASSERT_TRUE(result.tuned);
  const auto& [kp, kd, mu] = result.tuned->controller;
  EXPECT_GT(kd * std::pow(0.01, mu), 10);
  EXPECT_THAT(result.tuned->name, HasSubstr("above 10: nearly all of it is derivative"));
  EXPECT_EQ(remark_on(kPaperController, 6), "");
  const TuningResult refused = tune(kNonNewtonianModel, {1, 179});
  ASSERT_FALSE(refused.nearest.empty());
  EXPECT_GT(refused.nearest[0].controller.kd, 10);  // at 1 rad/s
  EXPECT_THAT(refused.nearest[0].name, HasSubstr("nearly all of it is derivative"));
}

// Orders and coefficients over many decades, crossovers and margins up to the ends of what can be asked.
TEST(TuneExtremes, EveryAnswerIsFinite) {
  std::mt19937 generator{31};
  const auto between = [&](double low, double high) { return std::uniform_real_distribution{low, high}(generator); };
  const auto decades = [&](double width) { return std::pow(10, between(-width, width)); };
  const auto one_of = [&](std::vector<double> values) {
    return values[std::uniform_int_distribution<std::size_t>{0, values.size() - 1}(generator)];
  };
  for (int i = 0; i < 25; ++i) {
    const double beta = one_of({1e-12, 1e-9, 1e-6, 1e-3, 0.5, 1}), width = one_of({0.5, 3, 12});
    const double alpha = one_of({beta + 1e-9, 2 * beta, beta + 0.5, 2});
    const FractionalModel plant{decades(width), one_of({0, decades(width)}), decades(width),
                                decades(width), std::min(alpha, 2.0),        beta};
    TuningSpec spec{one_of({1e-3, 0.3, 5, 100, 1e4}), one_of({0.1, 60, 90, 90 + 1e-6, 91, 120, 179.9})};
    spec.is_velocity_loop = between(0, 1) < 0.3;
    if (between(0, 1) < 0.3) spec.mu = one_of({0.01, 0.5, 1, 1.99});
    expect_answer(plant, spec);
  }
}

}  // namespace
}  // namespace control
