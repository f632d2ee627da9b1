// One model for several recordings: what each is uncertain of, all of them together determine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "control/identification/identify.hpp"
#include "control/sensor/sensor_path.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr FractionalModel kFluid{0.1, 0.0045, 0.15, 1, 1.75, 0.85};
constexpr double kPeriodS = 0.01;

IdentificationOptions fractional_only() {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::fractional;
  options.further_starts = 1;
  return options;
}

// Begins somewhere else each time.
Recording run_at(double offset_m, const std::vector<double>& duty, unsigned seed, const FractionalModel& fluid = kFluid,
                 double sd_m = 1e-4) {
  Recording run = position_run(fluid, duty, sd_m, seed);
  for (double& position_m : run.position_m) position_m += offset_m;
  return run;
}

std::vector<double> fast_duty() { return prbs_duty(0.8, 0.1, 4, kPeriodS); }

std::vector<double> slow_duty() { return prbs_duty(0.8, 1.5, 24, kPeriodS); }

void expect_same(const Fit& a, const Fit& b) {
  EXPECT_EQ(a.model.kp, b.model.kp);
  EXPECT_EQ(a.model.b1, b.model.b1);
  EXPECT_EQ(a.model.b2, b.model.b2);
  EXPECT_EQ(a.model.alpha, b.model.alpha);
  EXPECT_EQ(a.model.beta, b.model.beta);
  EXPECT_EQ(a.offset_m, b.offset_m);
  EXPECT_EQ(a.sse, b.sse);
  EXPECT_EQ(a.aic, b.aic);
  EXPECT_EQ(a.one_sigma, b.one_sigma);
  EXPECT_EQ(a.iterations, b.iterations);
  EXPECT_EQ(a.position_residual_m, b.position_residual_m);
}

TEST(IdentifyTogether, OneRecordingIsWhatIdentifyFinds) {
  const std::vector<Recording> runs{run_at(0.02, fast_duty(), 3)};
  IdentificationOptions options = unhurried_options();
  options.further_starts = 1;
  const Identification alone = identify(runs[0], options), together = identify_together(runs, options);
  expect_same(together.best, alone.best);
  EXPECT_EQ(together.warnings, alone.warnings);
  EXPECT_TRUE(together.runs.empty());
}

// A short run of fast changes shows b1 and alpha, a long step kp and b2: neither shows all.
TEST(IdentifyTogether, TwoRunsDetermineWhatNeitherDoesAlone) {
  const std::vector<Recording> runs{run_at(0.3, prbs_duty(1, 0.1, 1.5, kPeriodS), 1, kFluid, 6e-4),
                                    run_at(-0.1, std::vector<double>(2400, 0.8), 2, kFluid, 6e-4)};
  const Identification fast_alone = identify(runs[0], fractional_only()),
                       slow_alone = identify(runs[1], fractional_only());
  const Fit &fast = fast_alone.best, &slow = slow_alone.best;
  const Identification both = identify_together(runs, fractional_only());
  ASSERT_EQ(both.best.end, SearchEnd::converged);
  const std::array<double, kParameters> truth{0.1, 0.0045, 0.15, 1.75, 0.85};
  const std::array<double, kParameters> found{both.best.model.kp, both.best.model.b1, both.best.model.b2,
                                              both.best.model.alpha, both.best.model.beta};
  for (std::size_t i = 0; i < kParameters; ++i) {
    ASSERT_TRUE(both.best.one_sigma[i]);
    EXPECT_LT(std::abs(found[i] - truth[i]), 3.5 * *both.best.one_sigma[i]) << kParameterNames[i];
    EXPECT_LT(*both.best.one_sigma[i], fast.one_sigma[i].value_or(1e9)) << kParameterNames[i];
    EXPECT_LT(*both.best.one_sigma[i], slow.one_sigma[i].value_or(1e9)) << kParameterNames[i];
  }
  EXPECT_THAT(fast_alone.warnings, Contains(HasSubstr("this run cannot determine")));
  EXPECT_THAT(slow_alone.warnings, Contains(HasSubstr("this run cannot determine")));
  EXPECT_THAT(both.warnings, Not(Contains(HasSubstr("cannot determine"))));
  EXPECT_THAT(both.warnings, Not(Contains(HasSubstr("do not agree"))));
}

TEST(IdentifyTogether, EachRunHasItsOwnOffsetAndNoise) {
  const std::vector<Recording> runs{run_at(0.3, slow_duty(), 1, kFluid, 1e-4),
                                    run_at(-0.1, slow_duty(), 2, kFluid, 1e-3)};
  const Identification both = identify_together(runs, fractional_only());
  ASSERT_EQ(both.runs.size(), 2U);
  const Fit &first = both.runs[0].fit, &second = both.runs[1].fit;
  EXPECT_NEAR(first.offset_m, 0.3, 4 * first.offset_sigma_m.value_or(0));
  EXPECT_NEAR(second.offset_m, -0.1, 4 * second.offset_sigma_m.value_or(0));
  EXPECT_NEAR(first.residual_sd / 1e-4, 1, 0.1);
  EXPECT_NEAR(second.residual_sd / 1e-3, 1, 0.1);
  EXPECT_LT(3 * *first.offset_sigma_m, *second.offset_sigma_m);
  EXPECT_EQ(first.model.kp, second.model.kp);
  EXPECT_EQ(both.best.free_parameters, 7);  // five of the model, two offsets
  EXPECT_EQ(first.position_residual_m.size(), runs[0].duty.size());
}

TEST(IdentifyTogether, SigmasAreThoseOfTheSpread) {
  std::array<double, kParameters> squares{};
  constexpr int kSeeds = 12;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const std::vector<Recording> runs{run_at(0.3, fast_duty(), 100 + seed), run_at(-0.1, slow_duty(), 200 + seed)};
    IdentificationOptions options = fractional_only();
    options.further_starts = 0;
    const Fit fit = identify_together(runs, options).best;
    const std::array<double, kParameters> off{fit.model.kp - 0.1, fit.model.b1 - 0.0045, fit.model.b2 - 0.15,
                                              fit.model.alpha - 1.75, fit.model.beta - 0.85};
    for (std::size_t i = 0; i < kParameters; ++i) squares[i] += std::pow(off[i] / fit.one_sigma[i].value(), 2);
  }
  for (std::size_t i = 0; i < kParameters; ++i) {  // chi-square of 12: 99.9 % between 2.2 and 33
    EXPECT_GT(squares[i], 2.2) << kParameterNames[i];
    EXPECT_LT(squares[i], 33) << kParameterNames[i];
  }
}

TEST(IdentifyTogether, OrderDoesNotMatter) {
  const std::vector<Recording> runs{run_at(0.3, fast_duty(), 1), run_at(-0.1, slow_duty(), 2)};
  const std::vector<Recording> turned{runs[1], runs[0]};
  const Identification a = identify_together(runs, fractional_only());
  const Identification b = identify_together(turned, fractional_only());
  EXPECT_NEAR(a.best.model.kp / b.best.model.kp, 1, 1e-6);
  EXPECT_NEAR(a.best.model.b1 / b.best.model.b1, 1, 1e-4);
  EXPECT_NEAR(a.best.model.alpha / b.best.model.alpha, 1, 1e-5);
  EXPECT_NEAR(a.best.sse / b.best.sse, 1, 1e-9);
  EXPECT_NEAR(a.best.aic, b.best.aic, 1e-3);
  EXPECT_NEAR(a.runs[0].fit.offset_m, b.runs[1].fit.offset_m, 1e-8);
}

TEST(IdentifyTogether, RunsOfTwoFluidsDoNotAgree) {
  FractionalModel other = kFluid;
  other.kp *= 1.3;
  const std::vector<Recording> runs{run_at(0, slow_duty(), 1), run_at(0, slow_duty(), 2, other)};
  EXPECT_THAT(identify_together(runs, fractional_only()).warnings, Contains(HasSubstr("do not agree on one model")));
}

TEST(IdentifyTogether, WarningsOfOneRunStandInIt) {
  std::vector<Recording> runs{run_at(0, slow_duty(), 1), run_at(0, slow_duty(), 2)};
  runs[1].position_m[400] += 0.1;
  const Identification both = identify_together(runs, fractional_only());
  EXPECT_THAT(both.runs[0].warnings, Not(Contains(HasSubstr("robust sd"))));
  EXPECT_THAT(both.runs[1].warnings, Contains(HasSubstr("robust sd")));
}

TEST(IdentifyTogether, AbsoluteErrorIsHardlyDrawnByOutliers) {
  std::vector<Recording> runs{run_at(0.3, fast_duty(), 1), run_at(-0.1, fast_duty(), 2)};
  for (Recording& run : runs) {
    for (std::size_t k = 250; k < 400; k += 20) run.position_m[k] += 0.005;
  }
  IdentificationOptions options = fractional_only();
  const double drawn = std::abs(identify_together(runs, options).best.model.kp - 0.1);
  options.cost = Cost::absolute_error;
  const Fit robust = identify_together(runs, options).best;
  EXPECT_LT(std::abs(robust.model.kp - 0.1), 4 * robust.one_sigma[0].value());
  EXPECT_LT(std::abs(robust.model.kp - 0.1), drawn / 3);
}

TEST(IdentifyTogether, StructureIsChosenOverAllRuns) {
  const std::vector<Recording> runs{run_at(0.3, fast_duty(), 1), run_at(-0.1, slow_duty(), 2)};
  IdentificationOptions options = fractional_only();
  options.structure.reset();
  const Identification both = identify_together(runs, options);
  EXPECT_EQ(both.best.structure, Structure::fractional);
  EXPECT_EQ(both.compared.size(), 3U);
}

TEST(IdentifyTogether, DeadTimeIsCommon) {
  std::vector<Recording> runs;
  for (const double offset_m : {0.2, -0.1}) {
    Recording run = run_at(offset_m, slow_duty(), 1);
    const std::vector<double> late = output_of(kFluid, Channel::position, kPeriodS, run.duty, 0.037);
    std::ranges::transform(late, run.position_m.begin(), [&](double x) { return x + offset_m; });
    add_noise(run.position_m, 1e-4, offset_m > 0 ? 4 : 5);
    runs.push_back(run);
  }
  IdentificationOptions options = fractional_only();
  options.longest_dead_time_s = 0.2;
  const Fit fit = identify_together(runs, options).best;
  ASSERT_TRUE(fit.dead_time_sigma_s);
  EXPECT_NEAR(fit.model.dead_time_s, 0.037, 4 * *fit.dead_time_sigma_s);
  EXPECT_EQ(fit.free_parameters, 8);  // five, two offsets, one dead time
}

TEST(IdentifyTogether, IsCancelledAndLimited) {
  const std::vector<Recording> runs{run_at(0.3, fast_duty(), 1), run_at(-0.1, slow_duty(), 2)};
  IdentificationOptions options = fractional_only();
  int reports = 0;
  options.on_progress = [&](const Progress&) { return ++reports < 3; };
  EXPECT_EQ(identify_together(runs, options).best.end, SearchEnd::cancelled);
  options.on_progress = {};
  options.time_limit_s = 1e-9;
  const Identification none = identify_together(runs, options);
  EXPECT_EQ(none.best.end, SearchEnd::time_limit);
  EXPECT_EQ(none.best.starts, 0);
  EXPECT_TRUE(none.compared.empty() && none.warnings.empty() && none.runs.empty());
}

TEST(IdentifyTogether, RefusesTooManyRecordings) {
  const std::vector<Recording> many(kMostRecordings + 1, run_at(0, fast_duty(), 1));
  EXPECT_THROW(identify_together(many, fractional_only()), std::invalid_argument);
  EXPECT_THROW(identify_together({}, fractional_only()), std::invalid_argument);
}

// Of the acceleration: each run has a bias and a lag of its own.
TEST(IdentifyTogether, AccelerationsHaveTheirOwnBiasAndLag) {
  std::vector<Recording> runs;
  for (const double late : {0.0, 1.0}) {
    Recording run{kPeriodS, late > 0 ? slow_duty() : fast_duty(), {}, {}};
    const Eigen::VectorXd felt_m_s2 = OutputModel::with_means(kPeriodS, run.duty, 1e-9).output(kFluid);
    const SensorPath path({std::vector<double>(run.duty.size()), std::vector<bool>(run.duty.size()), false}, kPeriodS);
    const Eigen::VectorXd readings = path.sampled(felt_m_s2, {-(0.75 + late) * kPeriodS, kPeriodS, 0.25 * kPeriodS});
    for (const double reading : readings) run.acceleration_m_s2.push_back(reading + 0.05 * late);
    add_noise(run.acceleration_m_s2, 0.01, late > 0 ? 5 : 6);
    runs.push_back(run);
  }
  IdentificationOptions options = fractional_only();
  const Identification both = identify_together(runs, options);
  const Fit &fast = both.runs[0].fit, &slow = both.runs[1].fit;
  ASSERT_TRUE(fast.sensor && slow.sensor);
  EXPECT_NEAR(slow.sensor->delay_s - fast.sensor->delay_s, kPeriodS, 0.003);
  EXPECT_NEAR(slow.sensor->bias_m_s2 - fast.sensor->bias_m_s2, 0.05, 0.01);
  EXPECT_LT(std::abs(both.best.model.kp - kFluid.kp), 4 * both.best.one_sigma[0].value());
  EXPECT_LT(std::abs(both.best.model.alpha - kFluid.alpha), 4 * both.best.one_sigma[3].value());
}

}  // namespace
}  // namespace control
