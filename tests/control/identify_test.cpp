// Identification meets the reference optima and says what a run cannot tell.
#include "control/identification/identify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::Contains;
using testing::HasSubstr;

// As the reference was made.
IdentificationOptions reference_options() {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::fractional;
  options.further_starts = 0;
  options.fits_offset = false;
  return options;
}

IdentificationOptions first_start_only(Structure structure = Structure::fractional) {
  IdentificationOptions options = unhurried_options();
  options.structure = structure;
  options.further_starts = 0;
  return options;
}

void expect_model(const FractionalModel& found, const FractionalModel& expected, double relative) {
  EXPECT_NEAR(found.kp / expected.kp, 1, relative);
  if (expected.b1 > 0) EXPECT_NEAR(found.b1 / expected.b1, 1, relative);
  EXPECT_NEAR(found.b2 / expected.b2, 1, relative);
  EXPECT_NEAR(found.alpha / expected.alpha, 1, relative);
  EXPECT_NEAR(found.beta / expected.beta, 1, relative);
}

std::string refusal(const Recording& recording, const IdentificationOptions& options = {}) {
  try {
    identify(recording, options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

struct Reference : testing::Test {
  nlohmann::json file = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/identification_dataset.json"));

  Recording recording(std::size_t set) const {
    const auto& data = file["datasets"][set];
    Recording run{file["dt"], std::vector<double>(file["n"].get<std::size_t>(), file["u"]), {}, {}};
    (data["output"] == "position" ? run.position_m : run.velocity_m_s) = data["y"].get<std::vector<double>>();
    return run;
  }
};

TEST_F(Reference, OptimumIsReachedFromTheNewtonianModelAlone) {
  for (std::size_t set = 0; set < 3; ++set) {
    const Fit fit = identify(recording(set), reference_options()).best;
    const auto& expected = file["datasets"][set]["scipy_fit"];
    EXPECT_LE(fit.sse, expected["sse"].get<double>() * (1 + 1e-4)) << set;
    EXPECT_EQ(fit.end, SearchEnd::converged);
    EXPECT_LE(fit.iterations, 40);
    EXPECT_NEAR(fit.residual_sd / expected["residual_std"].get<double>(), 1, 1e-3);
    EXPECT_TRUE(fit.residuals_are_white);
  }
}

TEST_F(Reference, UncertaintyIsTheReferenceOne) {
  for (std::size_t set = 0; set < 3; ++set) {
    const Identification found = identify(recording(set), reference_options());
    const Fit& fit = found.best;
    const auto& expected = file["datasets"][set]["one_sigma"];
    EXPECT_NEAR(*fit.one_sigma[0] / fit.model.kp / expected["ln_kp"].get<double>(), 1, 0.02) << set;
    EXPECT_NEAR(*fit.one_sigma[1] / fit.model.b1 / expected["ln_b1"].get<double>(), 1, 0.02) << set;
    EXPECT_NEAR(*fit.one_sigma[2] / fit.model.b2 / expected["ln_b2"].get<double>(), 1, 0.02) << set;
    EXPECT_NEAR(*fit.one_sigma[3] / expected["alpha"].get<double>(), 1, 0.02) << set;
    EXPECT_NEAR(*fit.one_sigma[4] / expected["beta"].get<double>(), 1, 0.02) << set;
    if (set < 2) {
      EXPECT_NEAR(fit.model.alpha, 1.7263, 4 * *fit.one_sigma[3]);
    } else {
      EXPECT_THAT(found.warnings, Contains(HasSubstr("lies at its bound 2")));
      const auto at_bound = std::ranges::find(found.doubts, DoubtCode::parameter_at_bound, &Doubt::code);
      ASSERT_NE(at_bound, found.doubts.end());
      EXPECT_EQ(in_words(*at_bound), "alpha = 2 lies at its bound, where its sigma means little");
    }
  }
}

TEST(Identify, RecoversTheModelFromARunWithoutNoise) {
  for (const Channel channel : {Channel::position, Channel::velocity}) {
    Recording recording{0.01, std::vector<double>(501, 0.3), {}, {}};
    (channel == Channel::position ? recording.position_m : recording.velocity_m_s) =
        step_response(kNonNewtonianModel, channel, 0.3, 0.01, 501);
    expect_model(identify(recording, first_start_only()).best.model, kNonNewtonianModel, 1e-8);
  }
}

TEST(Identify, RecoversRandomModelsFromRandomDuties) {
  std::mt19937 generator(5);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  for (int i = 0; i < 4; ++i) {
    const FractionalModel truth{between(0.05, 2),   between(0.002, 0.05), between(0.05, 0.4), 1,
                                between(1.4, 1.95), between(0.5, 0.95)};
    std::vector<double> duty(401);
    for (double& u : duty) u = between(-1, 1);
    IdentificationOptions options = first_start_only();
    options.further_starts = 1;
    expect_model(identify(position_run(truth, duty, 0, 1), options).best.model, truth, 1e-8);
  }
}

TEST(Identify, TakesAnyDutyAndBothChannels) {
  const auto sine = [] {
    std::vector<double> duty(501);
    for (std::size_t k = 0; k < duty.size(); ++k) duty[k] = 0.5 * std::sin(1e-4 * static_cast<double>(k * k));
    return duty;
  }();
  for (const std::vector<double>& duty : {sine, prbs_duty(0.8, 0.1, 5, 0.01)}) {
    Recording recording = position_run(kNonNewtonianModel, duty, 1e-5, 3);
    recording.velocity_m_s = output_of(kNonNewtonianModel, Channel::velocity, 0.01, duty);
    add_noise(recording.velocity_m_s, 1e-3, 4);
    const Fit fit = identify(recording, first_start_only()).best;
    EXPECT_NEAR(fit.model.b2, 0.11031, 4 * *fit.one_sigma[2]);
    EXPECT_NEAR(fit.model.alpha, 1.7263, 4 * *fit.one_sigma[3]);
    EXPECT_LT(*fit.one_sigma[3], 0.05);
    EXPECT_EQ(fit.position_residual_m.size(), 501U);
    EXPECT_EQ(fit.velocity_residual_m_s.size(), 501U);
    recording.velocity_m_s.clear();
    EXPECT_LT(*fit.one_sigma[1], *identify(recording, first_start_only()).best.one_sigma[1]);
  }
}

TEST(Identify, FindsTheOffset) {
  Recording recording = position_run(kNonNewtonianModel, prbs_duty(1, 0.2, 5, 0.01), 0, 1);
  for (double& x : recording.position_m) x += 0.25;
  const Fit fit = identify(recording, first_start_only()).best;
  EXPECT_NEAR(fit.offset_m, 0.25, 1e-9);
  EXPECT_EQ(fit.free_parameters, 6);
  expect_model(fit.model, kNonNewtonianModel, 1e-7);
}

TEST(Identify, FindsTheDeadTimeBetweenSamples) {
  for (const double dead_time_s : {0.0333, 0.0871}) {
    const std::vector<double> duty = prbs_duty(1, 0.2, 4, 0.01);
    Recording recording{0.01, duty, output_of(kNonNewtonianModel, Channel::position, 0.01, duty, dead_time_s), {}};
    add_noise(recording.position_m, 1e-6, 1);
    IdentificationOptions options = first_start_only();
    options.longest_dead_time_s = 0.2;
    const Fit fit = identify(recording, options).best;
    ASSERT_TRUE(fit.dead_time_sigma_s);
    EXPECT_NEAR(fit.model.dead_time_s, dead_time_s, 4 * *fit.dead_time_sigma_s);
    EXPECT_NEAR(fit.model.dead_time_s, dead_time_s, 1e-3);
    EXPECT_NEAR(fit.residual_sd, 1e-6, 2e-7);
  }
}

TEST(Identify, ChoosesTheStructureOfTheModelByAic) {
  const std::vector<double> duty = prbs_duty(1, 0.2, 5, 0.01);
  IdentificationOptions options = unhurried_options();
  options.further_starts = 1;
  const std::vector<std::pair<Structure, FractionalModel>> cases{{Structure::first_order, {0.1, 0, 0.2, 1, 2, 1}},
                                                                 {Structure::second_order, {0.1, 0.01, 0.06, 1, 2, 1}},
                                                                 {Structure::fractional, kNonNewtonianModel}};
  for (const auto& [structure, model] : cases) {
    const Identification found = identify(position_run(model, duty, 1e-4, 9), options);
    EXPECT_EQ(found.best.structure, structure);
    ASSERT_EQ(found.compared.size(), 3U);
    EXPECT_TRUE(std::ranges::is_sorted(found.compared, {}, &Fit::aic));
    EXPECT_NEAR(found.best.model.b2 / model.b2, 1, 0.05);
  }
}

TEST(Identify, DoesNotDependOnUnits) {
  Recording recording = position_run(kNonNewtonianModel, prbs_duty(1, 0.2, 5, 0.01), 1e-4, 2);
  const Fit metres = identify(recording, first_start_only()).best;
  for (double& x : recording.position_m) x *= 1000;
  const Fit millimetres = identify(recording, first_start_only()).best;
  for (double& u : recording.duty) u *= 100;
  const Fit percent = identify(recording, first_start_only()).best;
  FractionalModel expected = metres.model;
  expected.kp *= 1000;
  expect_model(millimetres.model, expected, 1e-7);
  expected.kp /= 100;
  expect_model(percent.model, expected, 1e-7);
  EXPECT_NEAR(millimetres.fit_percent, metres.fit_percent, 1e-6);
  EXPECT_NEAR(*millimetres.one_sigma[3] / *metres.one_sigma[3], 1, 1e-5);
}

TEST(Identify, AbsoluteErrorIsNotMovedByOutliers) {
  Recording recording = position_run(kNonNewtonianModel, prbs_duty(1, 0.2, 4, 0.01), 1e-5, 6);
  for (std::size_t k = 7; k < recording.position_m.size(); k += 23) recording.position_m[k] += 0.02;
  IdentificationOptions options = first_start_only();
  const Fit squares = identify(recording, options).best;
  options.cost = Cost::absolute_error;
  const Fit absolute = identify(recording, options).best;
  EXPECT_LT(absolute.absolute_error, squares.absolute_error);
  EXPECT_LT(std::abs(absolute.model.b2 - 0.11031), 0.1 * std::abs(squares.model.b2 - 0.11031));
  EXPECT_NEAR(absolute.model.b2, 0.11031, 0.002);
  EXPECT_EQ(absolute.end, SearchEnd::converged);
}

TEST(Identify, EndsWhenCancelled) {
  const Recording recording = position_run(kNonNewtonianModel, std::vector<double>(301, 0.3), 1e-4, 2);
  IdentificationOptions options = unhurried_options();
  int calls = 0;
  options.on_progress = [&](const Progress& progress) {
    EXPECT_GE(progress.sse, 0);
    return ++calls < 3;
  };
  const Identification cancelled = identify(recording, options);
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(cancelled.best.end, SearchEnd::cancelled);
  EXPECT_THAT(cancelled.warnings, Contains(HasSubstr("was cancelled")));

  options = {};
  options.time_limit_s = 1e-9;
  const Identification untried = identify(recording, options);
  EXPECT_EQ(untried.best.end, SearchEnd::time_limit);
  EXPECT_EQ(untried.best.starts, 0);
  EXPECT_TRUE(untried.compared.empty() && untried.warnings.empty());

  options = first_start_only();
  options.iteration_limit = 2;
  const Fit fit = identify(recording, options).best;
  EXPECT_EQ(fit.end, SearchEnd::iteration_limit);
  EXPECT_EQ(fit.iterations, 2);
}

TEST(Identify, WarnsOfWhatItCannotTell) {
  Recording recording = position_run(kNonNewtonianModel, prbs_duty(1, 0.2, 4, 0.01), 1e-5, 2);
  EXPECT_TRUE(identify(recording, first_start_only()).warnings.empty());
  for (std::size_t k = 0; k < recording.position_m.size(); ++k) {
    recording.position_m[k] += 1e-3 * std::sin(0.3 * static_cast<double>(k));
  }
  EXPECT_THAT(identify(recording, first_start_only()).warnings,
              Contains(HasSubstr("residuals of position_m are not white")));
  const Recording lag = position_run({0.1, 0, 0.2, 1, 2, 1}, std::vector<double>(301, 0.3), 1e-4, 2);
  const std::vector<std::string> warnings = identify(lag, first_start_only()).warnings;
  EXPECT_THAT(warnings, Contains(HasSubstr("the duty is 0.3 throughout")));
  EXPECT_THAT(warnings, Contains(HasSubstr("cannot determine")));
}

TEST(Identify, RefusesWhatItCannotUse) {
  const Recording good = position_run(kNonNewtonianModel, std::vector<double>(101, 0.3), 1e-4, 2);
  const auto changed = [&](auto change) {
    Recording recording = good;
    change(recording);
    return refusal(recording);
  };
  EXPECT_THAT(refusal({}), HasSubstr("duty has 0 samples"));
  EXPECT_THAT(changed([](Recording& r) { r.position_m[4] = std::nan(""); }), HasSubstr("position_m[4] is nan"));
  EXPECT_THAT(changed([](Recording& r) { r.duty[5] = std::numeric_limits<double>::infinity(); }),
              HasSubstr("duty[5] is inf"));
  EXPECT_THAT(changed([](Recording& r) { r.position_m.pop_back(); }), HasSubstr("position_m has 100 values"));
  EXPECT_THAT(changed([](Recording& r) { r.duty.assign(101, 0); }), HasSubstr("excites nothing"));
  EXPECT_THAT(changed([](Recording& r) { r.position_m.assign(101, 1.5); }), HasSubstr("position_m is 1.5 throughout"));
  EXPECT_THAT(changed([](Recording& r) { r.dt_s = 0; }), HasSubstr("dt_s must be positive, is 0"));
  EXPECT_THAT(changed([](Recording& r) { r.position_m.clear(); }), HasSubstr("all empty"));
  EXPECT_THAT(changed([](Recording& r) { r.acceleration_m_s2 = r.position_m; }), HasSubstr("give it alone"));
  IdentificationOptions options = unhurried_options();
  options.longest_dead_time_s = 2;
  EXPECT_THAT(refusal(good, options), HasSubstr("longest_dead_time_s"));
  EXPECT_THAT(changed([](Recording& r) { r.dt_s = 1e-9; }), HasSubstr("dt_s must be from 1e-06 to 10000, is 1e-09"));
  EXPECT_THAT(changed([](Recording& r) { r.duty[3] = 2e4; }), HasSubstr("duty[3] is 20000, beyond 1000"));
  EXPECT_THAT(changed([](Recording& r) { r.duty.assign(101, 1e-12); }), HasSubstr("duty is at most 1e-12"));
  EXPECT_THAT(changed([](Recording& r) { r.position_m[3] = -1e200; }), HasSubstr("position_m reaches -1e+200"));
  EXPECT_THAT(changed([](Recording& r) {
                for (double& x : r.position_m) x *= 1e-100;
              }),
              HasSubstr("position_m varies by"));
}

TEST(MakeRecording, RefusesUnequalSteps) {
  std::vector<double> time_s, duty(30, 0.3), position_m;
  for (int k = 0; k < 30; ++k) time_s.push_back(1000 + 0.01 * k), position_m.push_back(k);
  EXPECT_NEAR(make_recording(time_s, duty, position_m, {}).dt_s, 0.01, 1e-12);
  time_s[7] += 0.002;
  EXPECT_THROW(make_recording(time_s, duty, position_m, {}), std::invalid_argument);
}

TEST(ExpectedUncertainty, IsThatOfTheReferencePlans) {
  const FractionalModel model;
  const auto prbs = expected_uncertainty(model, {0.01, prbs_duty(1, 0.2, 60, 0.01), 1.16e-3, 0, false});
  EXPECT_NEAR(*prbs.one_sigma[1] / model.b1, 0.074, 0.3 * 0.074);
  EXPECT_NEAR(*prbs.one_sigma[2] / model.b2, 0.0045, 0.3 * 0.0045);
  EXPECT_NEAR(*prbs.one_sigma[3], 0.021, 0.3 * 0.021);
  EXPECT_NEAR(*prbs.one_sigma[4], 0.0040, 0.3 * 0.0040);
  const auto step = expected_uncertainty(model, {0.01, step_duty(0.3, 5, 0.01), 1.16e-3, 0, false});
  EXPECT_NEAR(*step.one_sigma[1] / model.b1, 4.7, 0.1);
  EXPECT_NEAR(*step.one_sigma[3], 1.4, 0.1);
  const auto integer =
      expected_uncertainty(normalised(kNewtonianModel), {0.01, step_duty(0.3, 5, 0.01), 1e-3, 0, true});
  EXPECT_TRUE(integer.one_sigma[2]);
  EXPECT_FALSE(integer.one_sigma[3]);
  EXPECT_THROW(expected_uncertainty(model, {0.01, std::vector<double>(100, 0.0), 1e-3, 0, false}),
               std::invalid_argument);
  EXPECT_THROW(expected_uncertainty(model, {0.01, std::vector<double>(kMostSamples + 1, 0.3), 1e-3, 0, false}),
               std::invalid_argument);
}

TEST(ExpectedInformation, OfSeveralExperimentsAddsUpAndEachHasUnknownsOfItsOwn) {
  const FractionalModel model;
  PlannedExperiment fast{0.01, prbs_duty(0.6, 0.2, 20, 0.01)}, slow{0.01, prbs_duty(0.6, 1, 20, 0.01)};
  fast.acceleration_sd_m_s2 = slow.acceleration_sd_m_s2 = 0.05;
  const double one = expected_uncertainty(model, fast).one_sigma[3].value();
  ExpectedInformation four{model};
  EXPECT_FALSE(four.uncertainty().one_sigma[0]) << "nothing was added";
  for (int i = 0; i < 4; ++i) four.add(fast);
  EXPECT_NEAR(four.uncertainty().one_sigma[3].value(), one / 2, 1e-6 * one);
  ExpectedInformation once{model}, other{model}, both{model};
  once.add(fast);
  other.add(once, 4);
  EXPECT_NEAR(other.uncertainty().one_sigma[3].value(), one / 2, 1e-6 * one);
  both.add(slow);
  both.add(once);
  EXPECT_LT(both.uncertainty().one_sigma[3].value(), expected_uncertainty(model, slow).one_sigma[3].value());
  EXPECT_LT(both.uncertainty().one_sigma[3].value(), one);
}

TEST(Duties, HaveTheirShape) {
  EXPECT_EQ(step_duty(0.3, 5, 0.01), std::vector<double>(501, 0.3));
  const std::vector<double> duty = prbs_duty(0.5, 0.2, 60, 0.01);
  EXPECT_EQ(duty.size(), 6001U);
  int ups = 0;
  for (std::size_t k = 0; k < duty.size(); ++k) {
    EXPECT_EQ(std::abs(duty[k]), 0.5);
    EXPECT_EQ(duty[k], duty[k - k % 20]);
    ups += duty[k] > 0 ? 1 : 0;
  }
  EXPECT_NEAR(ups, 3000, 500);
  EXPECT_THROW(prbs_duty(std::nan(""), 0.2, 60, 0.01), std::invalid_argument);
  EXPECT_THROW(step_duty(std::nan(""), 60, 0.01), std::invalid_argument);
  EXPECT_EQ(step_duty(1, 1999.99, 0.01).size(), kMostSamples);
  EXPECT_THROW(step_duty(1, 2000, 0.01), std::invalid_argument);
}

}  // namespace
}  // namespace control
