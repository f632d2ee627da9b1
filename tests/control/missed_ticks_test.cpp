// A tick that a robot missed costs the fit that tick, and nothing else: the motor is on for 50 ms more, then off.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "control/search/fit_statistics.hpp"
#include "control/search/missed_ticks.hpp"
#include "control/sensor/sensor_path.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::HasSubstr;

constexpr double kDtS = 0.01;
const FractionalModel kFluid{0.1, 0.006, 0.11, 1, 2, 1};

IdentificationOptions one_start() {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::second_order;
  options.further_starts = 0;
  return options;
}

// Ticks 0 to last but for a share of them, and four in a row; the robot could not change its duty at those.
std::vector<std::size_t> most_ticks(std::size_t ticks, double missed_share, unsigned seed) {
  std::mt19937 random{seed};
  std::bernoulli_distribution misses{missed_share};
  std::vector<std::size_t> made;
  for (std::size_t k = 0; k < ticks; ++k) {
    const bool in_hole = k >= ticks / 3 && k < ticks / 3 + 4;
    const bool is_missed = k > 0 && k + 1 < ticks && (in_hole || misses(random));
    if (!is_missed) made.push_back(k);
  }
  return made;
}

// What the motor had: the board turns it off 50 ms, five periods, after the last tick.
std::vector<double> held(std::vector<double> duty, const std::vector<std::size_t>& ticks) {
  for (std::size_t i = 0; i + 1 < ticks.size(); ++i) {
    for (std::size_t k = ticks[i] + 1; k < ticks[i + 1]; ++k) duty[k] = k < ticks[i] + 5 ? duty[ticks[i]] : 0;
  }
  return duty;
}

std::vector<double> at(const std::vector<double>& values, const std::vector<std::size_t>& ticks) {
  std::vector<double> some;
  for (const std::size_t tick : ticks) {
    if (!values.empty()) some.push_back(values[tick]);
  }
  return some;
}

Recording sampled_at(const Recording& whole, const std::vector<std::size_t>& ticks) {
  std::vector<double> time_s;
  for (const std::size_t tick : ticks) time_s.push_back(kDtS * static_cast<double>(tick));
  return make_recording(time_s, at(whole.duty, ticks), at(whole.position_m, ticks), at(whole.velocity_m_s, ticks),
                        at(whole.acceleration_m_s2, ticks));
}

void expect_within_sigmas(const Fit& fit, double sigmas) {
  EXPECT_LT(std::abs(fit.model.kp - kFluid.kp), sigmas * *fit.one_sigma[0]);
  EXPECT_LT(std::abs(fit.model.b1 - kFluid.b1), sigmas * *fit.one_sigma[1]);
  EXPECT_LT(std::abs(fit.model.b2 - kFluid.b2), sigmas * *fit.one_sigma[2]);
}

TEST(MissedTicks, OnePercentCostsAPositionFitNothingButThoseValues) {
  const auto ticks = most_ticks(2001, 0.01, 3);
  const Recording whole = position_run(kFluid, held(prbs_duty(0.6, 0.2, 20, kDtS), ticks), 1e-4, 6);
  const Recording run = sampled_at(whole, ticks);
  ASSERT_GT(missed_ticks(run), 15U);
  EXPECT_THAT(run.duty, testing::Pointwise(testing::DoubleNear(1e-9), whole.duty));
  const Fit fit = identify(run, one_start()).best, all = identify(whole, one_start()).best;
  expect_within_sigmas(fit, 3);
  EXPECT_NEAR(*fit.one_sigma[1] / *all.one_sigma[1], 1, 0.05);
  EXPECT_NEAR(fit.residual_sd / 1e-4, 1, 0.05);
  EXPECT_TRUE(fit.residuals_are_white);
}

TEST(MissedTicks, TheMotorIsOffAfter50MsOfABlock) {
  std::vector<std::size_t> ticks;
  const auto is_blocked = [](std::size_t k) { return k % 500 >= 120 && k % 500 < 140; };  // 0.2 s, with the motor on
  for (std::size_t k = 0; k < 2001; ++k) {
    if (!is_blocked(k)) ticks.push_back(k);
  }
  std::vector<double> duty(2001);
  for (std::size_t k = 0; k < duty.size(); ++k) duty[k] = k % 500 >= 100 && k % 500 < 200 ? 0.6 : 0;
  const Recording whole = position_run(kFluid, held(duty, ticks), 1e-4, 5);
  ASSERT_DOUBLE_EQ(whole.duty[123], 0.6);
  ASSERT_DOUBLE_EQ(whole.duty[124], 0);
  const Recording run = sampled_at(whole, ticks);
  EXPECT_EQ(missed_ticks(run), 80U);
  EXPECT_THAT(run.duty, testing::Pointwise(testing::DoubleNear(1e-9), whole.duty));
  const Fit fit = identify(run, one_start()).best;
  expect_within_sigmas(fit, 3);
  EXPECT_TRUE(fit.residuals_are_white);
}

TEST(MissedTicks, APeriodInWhichTheMotorGoesOffHasItsMeanDuty) {
  Recording run{0.02, {0, 0.6, 0, 0}, {0, 0, 0.01, 0.01}, {}};
  place_at_ticks(run, std::vector<std::size_t>{0, 1, 6, 7});
  EXPECT_THAT(run.duty,
              testing::Pointwise(testing::DoubleNear(1e-9), std::vector<double>{0, 0.6, 0.6, 0.3, 0, 0, 0, 0}));
}

TEST(MissedTicks, TheLongestHoleIsATime) {
  EXPECT_EQ(most_missed_in_a_row(0.01), 25);
  EXPECT_EQ(most_missed_in_a_row(0.010001), 25) << "a time that was rounded";
  EXPECT_EQ(most_missed_in_a_row(0.1), 2);
  EXPECT_EQ(most_missed_in_a_row(1), 0);
  EXPECT_TRUE(most_missed_in_a_row(1e-300) > 1e200) << "no integer holds it";
}

TEST(MissedTicks, ColumnsOfAnotherLengthAreRefusedBeforeTheyArePlaced) {
  const auto ticks = most_ticks(101, 0, 4);
  std::vector<double> time_s;
  for (const std::size_t tick : ticks) time_s.push_back(kDtS * static_cast<double>(tick));
  const std::vector<double> duty(time_s.size(), 0.5), longer(time_s.size() + 50, 0.1), shorter(time_s.size() - 1, 0.1);
  const auto refusal = [&](const std::vector<double>& position_m, const std::vector<double>& velocity_m_s) {
    try {
      make_recording(time_s, duty, position_m, velocity_m_s);
    } catch (const std::invalid_argument& error) {
      return std::string{error.what()};
    }
    return std::string{"not refused"};
  };
  EXPECT_THAT(refusal(longer, {}), HasSubstr("position_m has 147 values, time_s has 97: give one per sample, or none"));
  EXPECT_THAT(refusal({}, longer), HasSubstr("velocity_m_s has 147 values, time_s has 97"));
  EXPECT_THAT(refusal(shorter, {}), HasSubstr("position_m has 96 values, time_s has 97"));
}

TEST(MissedTicks, AFitLeavesOutWhatIsFilledIn) {
  const auto ticks = most_ticks(1001, 0.03, 4);
  Recording run = sampled_at(position_run(kFluid, held(prbs_duty(0.6, 0.2, 10, kDtS), ticks), 1e-4, 5), ticks);
  const Fit before = identify(run, one_start()).best;
  for (std::size_t k = 0; k < run.duty.size(); ++k) {
    if (run.is_missed[k]) run.position_m[k] += 0.001;
  }
  const Fit after = identify(run, one_start()).best;
  EXPECT_NEAR(after.model.b1 / before.model.b1, 1, 1e-6);
  EXPECT_NEAR(after.model.kp / before.model.kp, 1, 1e-6);
}

// The model's own outputs, at the ticks that were made, are the only other source of what these must be.
TEST(MissedTicks, PercentAndWhitenessAreThoseOfTheTicksThatWereMade) {
  const auto ticks = most_ticks(2001, 0.04, 7);
  const Recording run = sampled_at(position_run(kFluid, held(prbs_duty(0.6, 0.2, 20, kDtS), ticks), 0.05, 5), ticks);
  const Fit fit = identify(run, one_start()).best;
  const std::vector<double> model_m = output_of(fit.model, Channel::position, kDtS, run.duty);
  Eigen::VectorXd kept(std::ssize(ticks)), residual(std::ssize(ticks));
  for (Eigen::Index i = 0; i < kept.size(); ++i) {
    const std::size_t tick = ticks[static_cast<std::size_t>(i)];
    kept[i] = run.position_m[tick];
    residual[i] = kept[i] - model_m[tick] - fit.offset_m;
  }
  EXPECT_NEAR(fit.fit_percent, 100 * (1 - residual.norm() / (kept.array() - kept.mean()).matrix().norm()), 1e-6);
  EXPECT_NEAR(*fit.position_whiteness_p_value, whiteness_p_value(residual), 1e-6);
  EXPECT_NEAR(fit.residual_sd, residual.norm() / std::sqrt(static_cast<double>(ticks.size())), 1e-9);
}

// The first 0.6 s are rough, and most of the first 0.2 s was not measured, which fits neither well nor badly.
TEST(MissedTicks, ARoughBeginningIsThatOfTheMeasuredValues) {
  std::vector<std::size_t> ticks{0};
  for (std::size_t k = 21; k < 2001; ++k) ticks.push_back(k);
  Recording whole = position_run(kFluid, held(prbs_duty(0.6, 0.2, 20, kDtS), ticks), 1e-4, 6);
  for (std::size_t k = 0; k < 60; ++k) whole.position_m[k] += k % 2 == 0 ? 5e-4 : -5e-4;
  EXPECT_THAT(identify(sampled_at(whole, ticks), one_start()).warnings,
              testing::Contains(HasSubstr("times worse than the rest")));
}

TEST(MissedTicks, OfAnAccelerometerToo) {
  const auto ticks = most_ticks(1501, 0.01, 6);
  Recording whole{kDtS, held(prbs_duty(0.6, 0.2, 15, kDtS), ticks), {}, {}};
  const Eigen::VectorXd felt_m_s2 = OutputModel::with_means(kDtS, whole.duty, 1e-9).output(kFluid);
  const SensorPath path({std::vector<double>(whole.duty.size()), std::vector<bool>(whole.duty.size()), false}, kDtS);
  const Eigen::VectorXd readings = path.sampled(felt_m_s2, {-0.75 * kDtS, kDtS, 0.25 * kDtS});
  whole.acceleration_m_s2.assign(readings.begin(), readings.end());
  add_noise(whole.acceleration_m_s2, 0.01, 5);
  for (double& reading : whole.acceleration_m_s2) reading = 0.01 * std::round(reading / 0.01);
  const Recording run = sampled_at(whole, ticks);
  const Fit fit = identify(run, one_start()).best, all = identify(whole, one_start()).best;
  ASSERT_TRUE(fit.sensor);
  EXPECT_TRUE(fit.sensor->readings_are_recovered);
  EXPECT_GE(fit.sensor->readings_left_out, missed_ticks(run));
  expect_within_sigmas(fit, 3);
  EXPECT_NEAR(*fit.one_sigma[1] / *all.one_sigma[1], 1, 0.1);
}

// Somebody has moved the robot meanwhile, and put it back: what was measured is wrong, and the duty is true.
TEST(MissedTicks, WhatIsLeftOutIsSimulatedThroughAndCountsForNothing) {
  std::vector<double> duty = prbs_duty(0.6, 0.2, 20, kDtS);
  for (std::size_t k = 800; k < 1200; ++k) duty[k] = 0;
  const Recording whole = position_run(kFluid, duty, 1e-4, 6);
  Recording run = whole;
  run.is_left_out.assign(run.duty.size(), false);
  for (std::size_t k = 820; k < 1200; ++k) {
    run.is_left_out[k] = true;
    run.position_m[k] += 0.05;
  }
  const Fit fit = identify(run, one_start()).best, all = identify(whole, one_start()).best;
  expect_within_sigmas(fit, 3);
  EXPECT_NEAR(*fit.one_sigma[1] / *all.one_sigma[1], 1, 0.1);
  EXPECT_NEAR(fit.residual_sd / 1e-4, 1, 0.05);
  EXPECT_TRUE(fit.residuals_are_white);
  run.is_left_out.pop_back();
  EXPECT_THROW(identify(run, one_start()), std::invalid_argument);
}

TEST(MissedTicks, WhatIsLeftOutOfAnAccelerometerCountsForNothing) {
  Recording run{kDtS, prbs_duty(0.6, 0.2, 15, kDtS), {}, {}};
  const Eigen::VectorXd felt_m_s2 = OutputModel::with_means(kDtS, run.duty, 1e-9).output(kFluid);
  const SensorPath path({std::vector<double>(run.duty.size()), std::vector<bool>(run.duty.size()), false}, kDtS);
  const Eigen::VectorXd readings = path.sampled(felt_m_s2, {-0.75 * kDtS, kDtS, 0.25 * kDtS});
  run.acceleration_m_s2.assign(readings.begin(), readings.end());
  add_noise(run.acceleration_m_s2, 0.01, 5);
  run.is_left_out.assign(run.duty.size(), false);
  for (std::size_t k = 500; k < 700; ++k) {
    run.is_left_out[k] = true;
    run.acceleration_m_s2[k] += 0.5;
  }
  const Fit fit = identify(run, one_start()).best;
  ASSERT_TRUE(fit.sensor);
  EXPECT_GE(fit.sensor->readings_left_out, 200U);
  expect_within_sigmas(fit, 3);
}

TEST(MissedTicks, AreNamedWithHowManyAndWhere) {
  const auto ticks = most_ticks(1001, 0, 4);
  const Recording run = sampled_at(position_run(kFluid, held(prbs_duty(0.6, 0.2, 10, kDtS), ticks), 1e-4, 5), ticks);
  EXPECT_THAT(missed_ticks_in_words(run), HasSubstr("4 of 1001 ticks are missing, the first at 3.33 s"));
  EXPECT_THAT(missed_ticks_in_words(run), HasSubstr("is assumed to have held for 50 ms and to have been 0"));
}

TEST(MissedTicks, TooManyAreRefusedWithTheNumbers) {
  const Recording whole = position_run(kFluid, prbs_duty(0.6, 0.2, 10, kDtS), 1e-4, 5);
  const auto refusal = [&](const std::vector<std::size_t>& ticks) {
    try {
      sampled_at(whole, ticks);
    } catch (const std::invalid_argument& error) {
      return std::string{error.what()};
    }
    return std::string{"not refused"};
  };
  EXPECT_THAT(refusal(most_ticks(1001, 0.08, 2)), HasSubstr("more than 5 %: cut out a part that has fewer holes"));
  std::vector<std::size_t> hole = most_ticks(1001, 0, 2);
  std::erase_if(hole, [](std::size_t tick) { return tick >= 500 && tick < 530; });
  EXPECT_THAT(refusal(hole), HasSubstr("30 steps of 0.01 s are missing, more than 0.25 s in a row"));
}

}  // namespace
}  // namespace control
