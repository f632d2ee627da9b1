// The sensor of a recorded acceleration: reads that failed count for nothing, and a search that is cut off says so.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <stop_token>
#include <thread>

#include "control/identification/fit_summary.hpp"
#include "control/search/output_error_search.hpp"
#include "control/sensor/sensor_clock.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr double kPeriodS = 0.01;
constexpr FractionalModel kFluid{0.1, 0.006, 0.11, 1, 2, 1};

// Each tick reads a sample 0.75 ticks old, after a low pass and `late_s`, a lag of the sensor or a dead time. Of the
// reads at which the acceleration moves by more than `moves_by_m_s2` a share fails, and repeats the last one.
Recording acceleration_run(double duration_s, double noise_m_s2, double failed_share, double moves_by_m_s2 = 0,
                           double late_s = 0, double time_constant_s = 0.25 * kPeriodS) {
  Recording run{kPeriodS, prbs_duty(0.6, 0.2, duration_s, kPeriodS), {}, {}};
  const std::vector<double> exact = output_of(kFluid, Channel::acceleration, kPeriodS, run.duty);
  const Eigen::VectorXd felt_m_s2 = OutputModel::with_means(kPeriodS, run.duty, 1e-9).output(kFluid);
  const SensorPath path({exact, std::vector<bool>(exact.size()), false}, kPeriodS);
  const Eigen::VectorXd readings = path.sampled(felt_m_s2, {-0.75 * kPeriodS - late_s, kPeriodS, time_constant_s});
  run.acceleration_m_s2.assign(readings.begin(), readings.end());
  add_noise(run.acceleration_m_s2, noise_m_s2, 5);
  std::mt19937 random{7};
  std::bernoulli_distribution fails{failed_share};
  for (std::size_t k = 1; k < exact.size(); ++k) {
    const bool moves = std::abs(exact[k] - exact[k - 1]) > moves_by_m_s2;
    if (moves && fails(random)) run.acceleration_m_s2[k] = run.acceleration_m_s2[k - 1];
  }
  return run;
}

IdentificationOptions one_start() {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::second_order;
  options.further_starts = 0;
  return options;
}

TEST(SensorSearch, FailedReadsHaveNoWeightInStepWithTheTicks) {
  const Fit fit = identify(acceleration_run(12, 0.01, 0.02), one_start()).best;
  ASSERT_TRUE(fit.sensor);
  EXPECT_FALSE(fit.sensor->has_own_clock);
  EXPECT_GT(fit.sensor->readings_left_out, 5U);
  EXPECT_LT(std::abs(fit.model.kp - kFluid.kp), 3 * *fit.one_sigma[0]);
  EXPECT_LT(std::abs(fit.model.b1 - kFluid.b1), 3 * *fit.one_sigma[1]);
  EXPECT_LT(std::abs(fit.model.b2 - kFluid.b2), 3 * *fit.one_sigma[2]);
}

Identification identified(double late_s, double longest_dead_time_s, std::optional<double> sensor_lag_s) {
  IdentificationOptions options = one_start();
  options.longest_dead_time_s = longest_dead_time_s;
  options.sensor_lag_s = sensor_lag_s;
  return identify(acceleration_run(6, 0.002, 0, 0, late_s), options);
}

// What the readings come later is a lag of the sensor or a dead time; the record shows the sum.
TEST(SensorSearch, SaysHowMuchDeadTimeTheAgeOfTheReadingsMayHide) {
  const auto is_said = Contains(AllOf(StartsWith("a dead time of up to 37."),
                                      HasSubstr(" ms cannot be told from the age of the sensor's readings: 37."),
                                      HasSubstr(" ms were attributed to the readings, none to the plant")));
  const Identification hidden = identified(0.03, 0, std::nullopt);
  EXPECT_THAT(hidden.warnings, is_said);
  EXPECT_EQ(hidden.best.model.dead_time_s, 0);
  EXPECT_NEAR(hidden.best.sensor->delay_s, 0.0375, 5e-4);

  const auto any = Contains(HasSubstr("dead time"));
  EXPECT_THAT(identified(0, 0, std::nullopt).warnings, Not(any));
  EXPECT_THAT(identified(0.03, 0, 0.03).warnings, Not(any));
  EXPECT_THAT(identified(0.03, 0, 0.01).warnings,
              Contains(HasSubstr("ms later than the sensor's own lag explains: that is a dead time")));
}

TEST(SensorSearch, ADeadTimeIsWhatTheSensorsOwnLagDoesNotExplain) {
  const Identification unknown = identified(0.03, 0.2, std::nullopt);
  EXPECT_NEAR(unknown.best.model.dead_time_s, 0.03, 0.003);
  EXPECT_NEAR(unknown.best.sensor->delay_s, unknown.best.model.dead_time_s + 0.005, 1e-9)
      << "the sum, with the mean age";
  EXPECT_THAT(unknown.warnings, Contains(HasSubstr("ms were attributed to the plant; give the sensor's own lag")));
  const Identification known = identified(0.03, 0.2, 0.01);
  EXPECT_NEAR(known.best.model.dead_time_s, 0.02, 0.003);
  EXPECT_NEAR(known.best.sensor->delay_s, known.best.model.dead_time_s + 0.01 + 0.005, 1e-9);
  EXPECT_THAT(known.warnings, Not(Contains(HasSubstr("cannot be told"))));
}

TEST(SensorSearch, ADeadTimeBeyondWhatTheReadingsMayHideIsNamedAndFound) {
  const Identification at_limit = identified(0.12, 0, std::nullopt);
  EXPECT_TRUE(at_limit.best.sensor->delay_is_at_limit);
  EXPECT_THAT(at_limit.warnings, Contains(HasSubstr("the most that is searched for without a dead time")));
  EXPECT_THAT(at_limit.warnings, Not(Contains(HasSubstr("with amplitude"))));
  EXPECT_FALSE(at_limit.amplitude);
  const Identification found = identified(0.12, 0.3, std::nullopt);
  EXPECT_NEAR(found.best.model.dead_time_s, 0.12, 0.003);
  EXPECT_FALSE(found.best.sensor->delay_is_at_limit);
}

Identification identified_by_itself(double late_s, std::optional<double> sensor_lag_s) {
  IdentificationOptions options = one_start();
  options.tries_dead_time = true;
  options.sensor_lag_s = sensor_lag_s;
  return identify(acceleration_run(6, 0.002, 0, 0, late_s), options);
}

TEST(SensorSearch, ADeadTimeThatNobodyNamedIsFoundWhereTheReadingsComeLater) {
  EXPECT_EQ(identified_by_itself(0, std::nullopt).best.model.dead_time_s, 0);
  EXPECT_EQ(identified_by_itself(0.03, 0.03).best.model.dead_time_s, 0) << "the sensor is so late";
  EXPECT_NEAR(identified_by_itself(0.03, std::nullopt).best.model.dead_time_s, 0.03, 0.003);
  EXPECT_NEAR(identified_by_itself(0.03, 0.01).best.model.dead_time_s, 0.02, 0.003);
  EXPECT_NEAR(identified_by_itself(0.12, std::nullopt).best.model.dead_time_s, 0.12, 0.003) << "beyond any lag";
}

TEST(SensorSearch, ADeadTimeThatNobodyNamedIsFoundInSeveralRunsTogether) {
  IdentificationOptions options = one_start();
  const std::vector<Recording> runs{acceleration_run(6, 0.002, 0, 0, 0.04), acceleration_run(4, 0.002, 0, 0, 0.04)};
  EXPECT_EQ(identify_together(runs, options).best.model.dead_time_s, 0) << "not looked for";
  options.tries_dead_time = true;
  const Identification found = identify_together(runs, options);
  EXPECT_NEAR(found.best.model.dead_time_s, 0.04, 0.003);
  const double of_age_s = 0.01 / std::sqrt(12.0);
  EXPECT_NEAR(dead_time_sd_s(found.doubts), std::hypot(0.005, of_age_s), 1e-9);
  const std::vector<Recording> prompt{acceleration_run(6, 0.002, 0), acceleration_run(4, 0.002, 0)};
  EXPECT_EQ(identify_together(prompt, options).best.model.dead_time_s, 0);
}

TEST(SensorSearch, WhatTheAgeOfTheReadingsHidesIsTheDoubtOfTheDeadTime) {
  const double of_age_s = 0.01 / std::sqrt(12.0);  // its samples keep step with the ticks
  EXPECT_NEAR(dead_time_sd_s(identified_by_itself(0.03, std::nullopt).doubts), std::hypot(0.005, of_age_s), 1e-9);
  EXPECT_NEAR(dead_time_sd_s(identified_by_itself(0.03, 0.01).doubts), of_age_s, 1e-9);
  const Identification at_limit = identified(0.12, 0, std::nullopt);
  EXPECT_TRUE(std::ranges::any_of(at_limit.doubts, [](const Doubt& doubt) {
    return doubt.code == DoubtCode::dead_time_not_determined && is_grave(doubt);
  }));
}

TEST(SensorSearch, ADelayThatNoSuchSensorHasIsADeadTimeInDoubtAsAWhole) {
  const Identification none = identified(0.03, 0, std::nullopt);  // and no dead time was asked for
  EXPECT_NEAR(dead_time_sd_s(none.doubts), 0.0325, 0.001);
}

TEST(SensorSearch, ASensorThatIsUnlikeItsDataSheetIsADoubt) {
  const auto is_of_low_pass = [](const Doubt& doubt) {
    return doubt.code == DoubtCode::sensor_unlike_data_sheet && doubt.parameter == "time_constant_s";
  };
  const Identification slow = identify(acceleration_run(12, 0.002, 0, 0, 0, 0.005), one_start());
  const auto doubt = std::ranges::find_if(slow.doubts, is_of_low_pass);
  ASSERT_NE(doubt, slow.doubts.end());
  EXPECT_NEAR(*doubt->value, std::log(slow.best.sensor->time_constant_s / 0.00255) / 0.1, 0.05);
  const double k = slow.best.free_parameters;
  EXPECT_NEAR(*doubt->widening, std::sqrt(1 + (*doubt->value * *doubt->value - 1) / k), 1e-9);
  EXPECT_TRUE(is_grave(*doubt));
  EXPECT_FALSE(std::ranges::any_of(identify(acceleration_run(12, 0.002, 0), one_start()).doubts, is_of_low_pass));
  const std::vector<Recording> runs{acceleration_run(12, 0.002, 0, 0, 0, 0.005), acceleration_run(6, 0.002, 0)};
  EXPECT_EQ(std::ranges::count_if(identify_together(runs, one_start()).doubts, is_of_low_pass), 1);
}

// No search that gives a model ends by the time.
TEST(SensorSearch, ABusyMachineChangesNoBit) {
  IdentificationOptions options = one_start();
  options.further_starts = 1;
  options.tries_dead_time = true;
  const Recording run = acceleration_run(6, 0.02, 0.01, 0, 0.03);
  const Identification alone = identify(run, options);
  Identification beside;
  {
    const auto spin = [](const std::stop_token& ended) {
      while (!ended.stop_requested()) continue;
    };
    const std::array<std::jthread, 3> busy{std::jthread{spin}, std::jthread{spin}, std::jthread{spin}};
    beside = identify(run, options);
  }
  const auto numbers = [](const Identification& found) {
    const Fit& fit = found.best;
    std::vector<double> all{fit.model.kp,
                            fit.model.b1,
                            fit.model.b2,
                            fit.model.dead_time_s,
                            fit.sse,
                            fit.aic,
                            fit.sensor->delay_s,
                            fit.sensor->period_s,
                            found.input->f,
                            found.amplitude->f,
                            fit.whiteness_p_value,
                            double(fit.iterations)};
    for (const auto& sigma : fit.one_sigma) all.push_back(sigma.value_or(-1));
    for (const Doubt& doubt : found.doubts) all.push_back(doubt.value.value_or(-1));
    all.insert(all.end(), fit.acceleration_residual_m_s2.begin(), fit.acceleration_residual_m_s2.end());
    return all;
  };
  EXPECT_GT(alone.best.model.dead_time_s, 0);
  EXPECT_EQ(numbers(beside), numbers(alone));
  EXPECT_EQ(beside.warnings, alone.warnings);
}

TEST(SensorSearch, NamesAnOptionOnlyToThoseWhoHaveIt) {
  const Recording run = acceleration_run(6, 0.002, 0, 0, 0.03);
  IdentificationOptions options = one_start();
  EXPECT_THAT(identify(run, options).warnings,
              Contains(AllOf(HasSubstr("search for the dead time"), Not(HasSubstr("(")))));
  options.names = {"--dead-time-s", "--sensor-lag-s", "--offset", "--structure"};
  EXPECT_THAT(identify(run, options).warnings, Contains(HasSubstr("search for the dead time (--dead-time-s)")));
}

// A short step is a run in which the sensor hardly shows.
TEST(SensorSearch, TheDataSheetCountsInTheSigmas) {
  Recording run = acceleration_run(6, 0.05, 0);
  OutputErrorSearch search(run, one_start());
  search.find_sensor();
  const SearchResult found = search.run(Structure::second_order);
  const Eigen::VectorXd off = search.prior_residuals(Structure::second_order, found.point);
  const Eigen::MatrixXd slopes = search.prior_slopes(Structure::second_order, found.point);
  ASSERT_EQ(off.size(), 2);  // in step with the ticks: lag and low pass
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 1.5);
  EXPECT_EQ(slopes.cols(), std::ssize(search.free_parameters(Structure::second_order)));
  SearchPoint slower = found.point;
  slower.sensor.time_constant_s *= 1.001;
  const Eigen::VectorXd moved = search.prior_residuals(Structure::second_order, slower) - off;
  EXPECT_NEAR(moved[1], slopes(1, slopes.cols() - 1) * 0.001 * found.point.sensor.time_constant_s, 1e-4);
  EXPECT_NEAR(moved[0], 0, 1e-12);
}

TEST(SensorSearch, DoubtsALagOfTheSensorThatTheReadingsDoNotHave) {
  const auto is_said = Contains(HasSubstr("less than the sensor's own lag that was given"));
  for (const double sensor_lag_s : {0.06, 2.0}) {
    for (const double longest_dead_time_s : {0.0, 0.2}) {
      EXPECT_THAT(identified(0.03, longest_dead_time_s, sensor_lag_s).warnings, is_said) << sensor_lag_s;
    }
  }
  EXPECT_THAT(identified(0.03, 0.2, 0.03).warnings, Not(is_said));
}

TEST(SensorSearch, ALagOfTheSensorNeedsASensor) {
  const std::vector<double> duty = prbs_duty(0.6, 0.2, 4, kPeriodS);
  IdentificationOptions options = unhurried_options();
  options.sensor_lag_s = 0.01;
  EXPECT_THROW(identify(position_run(kFluid, duty, 1e-4, 1), options), std::invalid_argument);
  options.sensor_lag_s = -0.01;
  EXPECT_THROW(identify(acceleration_run(4, 0.01, 0), options), std::invalid_argument);
}

TEST(SensorSearch, LeavesNoModelWhenItsTimeRunsOut) {
  const Recording run = acceleration_run(6, 0.01, 0);
  IdentificationOptions options = one_start();
  options.time_limit_s = 1;
  for (const double look_s : {0.05, 0.002, 0.0}) {  // each look at the clock takes so long
    double now_s = 0, takes_s = look_s;
    OutputErrorSearch search(run, options, [&] { return now_s += takes_s; });
    search.find_sensor();
    EXPECT_EQ(search.limit().has_passed(), look_s > 0) << look_s;
    takes_s = 0;
    const SearchResult found = search.run(Structure::second_order);
    EXPECT_EQ(found.end, look_s > 0 ? SearchEnd::time_limit : SearchEnd::converged);
    EXPECT_EQ(found.starts > 0, look_s == 0);
  }
  options.time_limit_s = 1e-9;
  EXPECT_EQ(identify(run, options).best.end, SearchEnd::time_limit);
  EXPECT_EQ(evaluate(kFluid, run, options).end, SearchEnd::time_limit);
}

TEST(SensorClock, IsAskedToStopBetweenItsSteps) {
  Eigen::VectorXd expected_m_s2(400);
  for (Eigen::Index k = 0; k < expected_m_s2.size(); ++k) expected_m_s2[k] = std::sin(0.9 * static_cast<double>(k));
  const std::vector<bool> is_repeated(400);
  int looks = 0, last_look = 1000000;
  const Stop stop = [&] { return ++looks >= last_look; };
  const ClockEvidence evidence{kPeriodS, expected_m_s2, expected_m_s2, is_repeated, 0.01, stop};
  const auto clock = find_clock(evidence, 0);
  ASSERT_TRUE(clock);
  const int all_looks = looks;
  EXPECT_GT(all_looks, 40);
  for (const int last : {1, 30, all_looks}) {
    looks = 0, last_look = last;
    EXPECT_FALSE(find_clock(evidence, 0));
    EXPECT_EQ(looks, last);
  }
  looks = 0, last_look = 1;
  const ReadOrder order = find_order(evidence, clock->timing, clock->order, 1e-3);
  EXPECT_EQ(order.first_available_s, clock->order.first_available_s);
  looks = 0, last_look = 300;
  find_order(evidence, clock->timing, clock->order, 1e-3);
  EXPECT_EQ(looks, 300);
}

Fit fit_with_sigmas_by_the_absolute_error(const Recording& run) {
  OutputErrorSearch search(run, one_start());
  search.find_sensor();
  return summary(search, run, Cost::absolute_error, Structure::second_order, search.run(Structure::second_order));
}

TEST(SensorSearch, ReadingsThatCountForNothingDoNotMakeAFitSurer) {
  const Fit whole = fit_with_sigmas_by_the_absolute_error(acceleration_run(12, 2e-3, 0));
  const Fit fit = fit_with_sigmas_by_the_absolute_error(acceleration_run(12, 2e-3, 0.6, 0.1));
  const std::vector<double>& residual = fit.acceleration_residual_m_s2;
  const double samples = static_cast<double>(residual.size());
  const double counted = samples - static_cast<double>(fit.sensor->readings_left_out);
  ASSERT_LT(counted, 0.97 * samples);
  for (const std::size_t parameter : {0U, 1U, 2U}) {
    EXPECT_GT(*fit.one_sigma[parameter], 0.95 * *whole.one_sigma[parameter]) << kParameterNames[parameter];
  }
  double sum = 0, squares = 0;
  for (const double r : residual) sum += std::abs(r), squares += r * r;
  EXPECT_NEAR(fit.residual_sd, std::sqrt(squares / counted), 1e-12);
  EXPECT_NEAR(fit.aic, 2 * counted * std::log(sum / counted) + 2 * fit.free_parameters, 1e-6);
}

}  // namespace
}  // namespace control
