// What is wrong with a run is said, in the words of its cause, and not said where nothing is wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>

#include "control/identification/identify.hpp"
#include "control/search/fit_statistics.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::AnyOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const FractionalModel kFirstOrder{0.1, 0, 0.2, 1, 2, 1};

IdentificationOptions one_start(Structure structure) {
  IdentificationOptions options = unhurried_options();
  options.structure = structure;
  options.further_starts = 0;
  return options;
}

Recording lag_run(double sd_m = 1e-4, std::size_t samples = 401) {
  std::vector<double> duty = prbs_duty(1, 0.2, 0.01 * static_cast<double>(samples - 1), 0.01);
  return position_run(kFirstOrder, duty, sd_m, 4);
}

Recording two_channel_run() {
  Recording run = lag_run();
  run.velocity_m_s = output_of(kFirstOrder, Channel::velocity, 0.01, run.duty);
  add_noise(run.velocity_m_s, 1e-3, 8);
  return run;
}

std::vector<std::string> warnings_of(const Recording& run,
                                     const IdentificationOptions& options = one_start(Structure::first_order)) {
  return identify(run, options).warnings;
}

TEST(IdentifyDoubts, AreNoneForACleanRun) {
  EXPECT_THAT(warnings_of(lag_run()), IsEmpty());
  EXPECT_EQ(identify(lag_run(), one_start(Structure::first_order)).doubts.size(), 0U);
  EXPECT_THAT(warnings_of(two_channel_run()), IsEmpty());
  IdentificationOptions options = one_start(Structure::first_order);
  options.fits_offset = false;
  EXPECT_THAT(warnings_of(lag_run(), options), IsEmpty());
  options.cost = Cost::absolute_error;
  EXPECT_THAT(warnings_of(lag_run(), options), IsEmpty());
}

TEST(IdentifyDoubts, AnUnknownOffsetIsFittedByDefaultAndMissedAloud) {
  for (const Structure structure : {Structure::first_order, Structure::fractional}) {
    Recording run = position_run(kFirstOrder, step_duty(0.3, 3, 0.01), 1e-4, 4);
    for (double& x : run.position_m) x += 0.01;
    IdentificationOptions options = one_start(structure);
    const Identification found = identify(run, options);
    EXPECT_NEAR(found.best.offset_m, 0.01, 5e-4);
    EXPECT_THAT(found.warnings, Not(Contains(HasSubstr("offset"))));
    options.fits_offset = false;
    EXPECT_THAT(warnings_of(run, options), Contains(HasSubstr("position_m begins at 0.0")));
  }
}

TEST(IdentifyDoubts, ARunThatBeginsInMotionIsNamed) {
  for (const Structure structure : {Structure::first_order, Structure::fractional}) {
    for (const bool has_velocity : {false, true}) {
      Recording run = has_velocity ? two_channel_run() : lag_run();
      for (std::size_t k = 0; k < run.duty.size(); ++k) {
        const double decay = std::exp(-0.01 * static_cast<double>(k) / 0.2);
        run.position_m[k] += 0.1 * 0.2 * (1 - decay);
        if (has_velocity) run.velocity_m_s[k] += 0.1 * decay;
      }
      const auto warnings = warnings_of(run, one_start(structure));
      EXPECT_THAT(warnings, Contains(HasSubstr("begin the record at rest")));
      EXPECT_THAT(warnings, Not(Contains(HasSubstr("change with amplitude"))));
    }
  }
}

// Taking the stated cost off brings the parameters most of the way back.
TEST(IdentifyDoubts, AStartInMotionIsNamedWithWhatItCostsTheParameters) {
  Recording run = lag_run(1e-5, 801);
  for (std::size_t k = 0; k < run.duty.size(); ++k) {
    run.position_m[k] += 0.02 * 0.2 * (1 - std::exp(-0.01 * static_cast<double>(k) / 0.2));
  }
  const Identification found = identify(run, one_start(Structure::first_order));
  const std::regex cost{R"(costs the fit, to first order, kp by (\S+) %, b2 by (\S+) % )"};
  std::smatch percent;
  const auto named = std::ranges::find_if(
      found.warnings, [&](const std::string& warning) { return std::regex_search(warning, percent, cost); });
  ASSERT_NE(named, found.warnings.end()) << testing::PrintToString(found.warnings);
  const double off = std::log(found.best.model.b2 / kFirstOrder.b2);
  EXPECT_GT(std::abs(off), 0.003);
  EXPECT_LT(std::abs(off - std::stod(percent[2]) / 100), 0.3 * std::abs(off)) << *named;
}

TEST(IdentifyDoubts, AMotionThatNoRecordTellsFromRestIsNone) {
  for (const auto& [scale, is_named] : {std::pair{1.0, true}, {1e-3, true}, {1e-5, false}, {1e-13, false}}) {
    Recording run = lag_run(1e-5, 801);
    for (std::size_t k = 0; k < run.duty.size(); ++k) {
      run.position_m[k] += 0.02 * 0.2 * (1 - std::exp(-0.01 * static_cast<double>(k) / 0.2));
      run.position_m[k] *= scale;
    }
    const auto warnings = warnings_of(run);
    EXPECT_THAT(warnings, is_named ? testing::Matcher<std::vector<std::string>>(Contains(HasSubstr("in motion")))
                                   : Not(Contains(HasSubstr("in motion"))))
        << scale;
  }
}

TEST(IdentifyDoubts, ColourOfEitherChannelCounts) {
  for (const bool is_position : {true, false}) {
    Recording run = two_channel_run();
    std::vector<double>& channel = is_position ? run.position_m : run.velocity_m_s;
    const double size = is_position ? 2e-4 : 2e-3;
    for (std::size_t k = 0; k < channel.size(); ++k) channel[k] += size * std::sin(0.9 * static_cast<double>(k));
    const Identification found = identify(run, one_start(Structure::first_order));
    EXPECT_FALSE(found.best.residuals_are_white);
    EXPECT_EQ(found.best.whiteness_p_value,
              std::min(*found.best.position_whiteness_p_value, *found.best.velocity_whiteness_p_value));
    const char* name =
        is_position ? "residuals of position_m are not white" : "residuals of velocity_m_s are not white";
    EXPECT_THAT(found.warnings, Contains(HasSubstr(name)));
  }
}

TEST(IdentifyDoubts, ABiasIsNamedWithItsSize) {
  Recording run = two_channel_run();
  for (double& v : run.velocity_m_s) v += 5e-4;
  EXPECT_THAT(warnings_of(run), Contains(testing::ContainsRegex("velocity_m_s lies 0.000[456].* m/s beside")));
}

TEST(IdentifyDoubts, OutliersAreCountedAndTheRemedyIsNamed) {
  Recording run = lag_run(1e-4, 2001);
  for (const std::size_t k : {300U, 700U, 1100U, 1500U, 1900U}) run.position_m[k] += 0.5;
  const std::vector<std::string> warnings = warnings_of(run);
  EXPECT_THAT(warnings, Contains(HasSubstr("5 of the 2001 values of position_m")));
  EXPECT_THAT(warnings, Contains(HasSubstr("the first at 3 s")));
  EXPECT_THAT(warnings, Contains(HasSubstr("use the absolute error cost")));
}

TEST(IdentifyDoubts, ATurnedSignIsNamed) {
  Recording run = lag_run();
  for (double& x : run.position_m) x = -x;
  for (const Structure structure : {Structure::first_order, Structure::fractional}) {
    const std::vector<std::string> warnings = warnings_of(run, one_start(structure));
    EXPECT_THAT(warnings, Contains(HasSubstr("turn one sign")));
    EXPECT_THAT(warnings, Not(Contains(HasSubstr("would give"))));
  }
  Recording both = two_channel_run();
  for (double& v : both.velocity_m_s) v = -v;
  EXPECT_THAT(warnings_of(both), Contains(HasSubstr("the sign of velocity_m_s turned round")));
}

TEST(IdentifyDoubts, APoorFitPlansNoExperiment) {
  Recording run = lag_run();
  std::fill(run.position_m.begin(), run.position_m.end(), 0);
  add_noise(run.position_m, 1, 5);
  const std::vector<std::string> warnings = warnings_of(run, one_start(Structure::fractional));
  EXPECT_THAT(warnings, Contains(HasSubstr("the model explains only")));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("would give"))));
}

TEST(IdentifyDoubts, ThePlanIsNotTheRunThatWasMade) {
  const Recording run = position_run(kNonNewtonianModel, prbs_duty(1, 0.2, 60, 0.01), 0.05, 4);
  const std::vector<std::string> warnings = warnings_of(run, one_start(Structure::fractional));
  EXPECT_THAT(warnings, Contains(HasSubstr("cannot determine")));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("would give"))));
  EXPECT_THAT(warnings, Contains(HasSubstr("make the run longer")));
}

// Whatever the noise: the sigmas are large, or a model with whole orders is better, or hardly worse.
TEST(IdentifyDoubts, OneStepDoesNotDetermineTheOrders) {
  std::vector<double> duty(800, 0);
  std::fill(duty.begin() + 100, duty.begin() + 600, 0.3);
  IdentificationOptions options = unhurried_options();
  options.further_starts = 1;
  int hardly_worse = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Recording run{0.01, duty, {}, {}, output_of(kNonNewtonianModel, Channel::acceleration, 0.01, duty)};
    add_noise(run.acceleration_m_s2, 0.012, seed);
    const std::vector<std::string> warnings = identify(run, options).warnings;
    EXPECT_THAT(warnings, Contains(AnyOf(HasSubstr("cannot determine"), HasSubstr("does not call for")))) << seed;
    const auto names_a_rival = [](const std::string& one) { return one.contains("second order model is higher by"); };
    hardly_worse += std::ranges::any_of(warnings, names_a_rival) ? 1 : 0;
  }
  EXPECT_GT(hardly_worse, 0);
}

TEST(IdentifyDoubts, AFastDutyDeterminesThem) {
  const Recording run = position_run(kNonNewtonianModel, prbs_duty(1, 0.2, 60, 0.01), 1.16e-3, 4);
  IdentificationOptions options = unhurried_options();
  options.further_starts = 0;
  EXPECT_THAT(identify(run, options).warnings, Not(Contains(HasSubstr("cannot determine"))));
}

TEST(IdentifyDoubts, ADeadTimeAtItsLimitComesFirst) {
  Recording run = lag_run();
  run.position_m = output_of(kFirstOrder, Channel::position, 0.01, run.duty, 0.15);
  add_noise(run.position_m, 1e-4, 1);
  for (const Structure structure : {Structure::first_order, Structure::fractional}) {
    IdentificationOptions options = one_start(structure);
    options.longest_dead_time_s = 0.05;
    const std::vector<std::string> warnings = warnings_of(run, options);
    ASSERT_FALSE(warnings.empty());
    EXPECT_THAT(warnings.front(), HasSubstr("lies at the longest that was allowed, 0.05 s"));
    EXPECT_THAT(warnings, Not(Contains(HasSubstr("do not need this fractional order"))));
  }
}

const Doubt* doubt_in(const Identification& found, DoubtCode code) {
  const auto doubt = std::ranges::find(found.doubts, code, &Doubt::code);
  return doubt == found.doubts.end() ? nullptr : &*doubt;
}

TEST(IdentifyDoubts, ASearchThatALimitEndedHasNoWidthThatAnybodyKnows) {
  IdentificationOptions options = one_start(Structure::fractional);
  options.iteration_limit = 2;
  const Identification found = identify(lag_run(), options);
  const Doubt* doubt = doubt_in(found, DoubtCode::search_not_converged);
  ASSERT_NE(doubt, nullptr);
  EXPECT_EQ(doubt->value, 2);
  EXPECT_TRUE(is_grave(*doubt));
  EXPECT_EQ(widening(found.doubts), std::nullopt);
}

// Its size counts: the same p of a shorter colour would be no grave one.
TEST(IdentifyDoubts, ResidualsThatAreAlikeWidenByHowManyAre) {
  Recording run = lag_run(0);
  std::vector<double> noise(run.position_m.size());
  add_noise(noise, 1e-4, 4);
  double slow = 0;
  for (std::size_t k = 0; k < noise.size(); ++k) run.position_m[k] += slow = 0.95 * slow + noise[k];
  const Identification found = identify(run, one_start(Structure::first_order));
  const Doubt* doubt = doubt_in(found, DoubtCode::residuals_not_white);
  ASSERT_NE(doubt, nullptr);
  EXPECT_NEAR(*doubt->widening, std::sqrt((1 + 0.95) / (1 - 0.95)), 2.5) << "of an autoregression of the first order";
  EXPECT_TRUE(is_grave(*doubt));
  EXPECT_GE(*widening(found.doubts), *doubt->widening);
}

TEST(IdentifyDoubts, CombineAsIndependentOnesDo) {
  EXPECT_EQ(widening({}), 1);
  const std::vector<Doubt> doubts{{DoubtCode::residuals_drift, 2, {}, 2}, {DoubtCode::residuals_not_white, 3, {}, 3}};
  EXPECT_DOUBLE_EQ(*widening(doubts), std::sqrt(1 + 3 + 8));
  EXPECT_FALSE(is_grave(doubts[0])) << "it just doubles";
  EXPECT_TRUE(is_grave(doubts[1]));
}

TEST(IdentifyDoubts, ResidualsThatAreNoNumbersAreNotWhite) {
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(50);
  EXPECT_EQ(whiteness_p_value(residual), 1);
  residual[7] = std::nan("");
  EXPECT_EQ(whiteness_p_value(residual), 0);
}

TEST(IdentifyDoubts, SharesAreNumbersThatAPersonReads) {
  const auto used = [](double share) { return in_words({DoubtCode::part_of_run_used, share}); };
  EXPECT_EQ(used(0.99868), "the fit used 99.87 % of the run");
  EXPECT_EQ(used(0.66), "the fit used 66 % of the run");
  for (const double share : {0.04, 0.994, 0.9951, 0.99999, 1.0}) {
    const std::string words = in_words({DoubtCode::runs_disagree, share});
    EXPECT_THAT(words, Not(HasSubstr("e+"))) << share;
  }
  EXPECT_THAT(in_words({DoubtCode::residuals_not_white, 123.4}), HasSubstr("by a factor of 123"));
}

}  // namespace
}  // namespace control
