// Identification from a position that was measured from outside, at times of its own and on a clock that is a little
// off.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "control/identification/identify.hpp"
#include "control/models/modal_plant.hpp"
#include "control/sensor/position_times.hpp"
#include "control/sensor/position_weight.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

constexpr double kTickS = 0.01;

struct Camera {
  double rate_hz = 30;
  double noise_sd_m = 0.0005;
  double clock_late_s = 0;  // its times are so much too small
};

// What the plant does under the duty, on a grid of 1 ms, so that the camera may look when it likes.
std::vector<double> fine_positions(const FractionalModel& plant, const std::vector<double>& duty) {
  ModalPlant motion{plant, kTickS / 10};
  std::vector<double> position_m;
  for (const double u : duty) {
    for (int k = 0; k < 10; ++k) {
      position_m.push_back(motion.position_m());
      motion.step(u);
    }
  }
  return position_m;
}

Recording watched(const FractionalModel& plant, const Camera& camera, unsigned seed) {
  Recording recording;
  recording.dt_s = kTickS;
  recording.duty = prbs_duty(0.6, 0.3, 40, kTickS);
  const std::vector<double> truth_m = fine_positions(plant, recording.duty);
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0, camera.noise_sd_m};
  for (double at_s = 0.05 + 0.001 * seed; at_s < 39.8; at_s += 1 / camera.rate_hz) {
    const auto k = static_cast<std::size_t>(1000 * at_s);
    recording.position_time_s.push_back(at_s - camera.clock_late_s);
    recording.position_m.push_back(0.2 + noise(random) +
                                   std::lerp(truth_m[k], truth_m[k + 1], 1000 * at_s - static_cast<double>(k)));
  }
  return recording;
}

std::array<double, kParameters> values(const FractionalModel& m) { return {m.kp, m.b1, m.b2, m.alpha, m.beta}; }

TEST(ReferenceFit, ParametersComeOutWithinThreeSigmasWhateverTheCamerasClock) {
  FractionalModel plant = normalised(kNonNewtonianModel);
  plant.b1 *= 0.7, plant.b2 *= 1.3, plant.alpha = 1.65;
  int within = 0, parameters = 0;
  double squares = 0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Camera camera{.clock_late_s = 0.001 * (seed % 5) - 0.002};
    const Recording recording = watched(plant, camera, seed);
    IdentificationOptions options = unhurried_options();
    options.structure = Structure::fractional;
    options.further_starts = 0;
    const Fit fit = identify(recording, options).best;
    ASSERT_EQ(fit.end, SearchEnd::converged);
    EXPECT_EQ(fit.position_residual_m.size(), recording.position_m.size());
    EXPECT_NEAR(fit.residual_sd, 0.0005, 0.00003);
    EXPECT_TRUE(fit.residuals_are_white) << seed;
    EXPECT_NEAR(fit.position_clock_s, camera.clock_late_s, 4 * fit.position_clock_sigma_s.value());
    for (std::size_t i = 0; i < kParameters; ++i) {
      const double sigmas = (values(fit.model)[i] - values(plant)[i]) / fit.one_sigma[i].value();
      within += std::abs(sigmas) < 3 ? 1 : 0;
      ++parameters;
      squares += sigmas * sigmas;
    }
  }
  EXPECT_GE(within, parameters - 1);
  EXPECT_LT(squares / parameters, 2.5);  // the sigmas are honest: 1 is exact
}

// 5 ms are nearly the same to the model as a change of its fastest lag: only the sigmas tell whether they were unknown.
TEST(ReferenceFit, ABelievedClockIsNoUnknown) {
  const Recording recording = watched(normalised(kNonNewtonianModel), {.clock_late_s = 0.005}, 3);
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::fractional;
  options.further_starts = 0;
  const Fit free = identify(recording, options).best;
  EXPECT_NEAR(free.position_clock_s, 0.005, 3 * free.position_clock_sigma_s.value());
  options.fits_position_clock = false;
  const Fit believed = identify(recording, options).best;
  EXPECT_FALSE(believed.position_clock_sigma_s);
  EXPECT_GE(believed.sse, free.sse);
}

// Every third position is 40 times as uncertain as the others, as where a marker was half hidden.
TEST(ReferenceFit, PositionsWeighByTheirOwnSds) {
  const FractionalModel plant = normalised(kNonNewtonianModel);
  constexpr double kSure = 0.0003, kUnsure = 0.012;
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::second_order;  // parameters of which the run is sure
  options.further_starts = 0;
  FractionalModel second_order = plant;
  second_order.alpha = 2, second_order.beta = 1;
  double squares = 0, chi_square_per_value = 0;
  int parameters = 0;
  constexpr unsigned kSeeds = 2;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    Recording recording = watched(second_order, {.noise_sd_m = kSure}, seed);
    std::mt19937 random{100 + seed};
    std::normal_distribution<double> noise{0, kUnsure};
    for (std::size_t k = 0; k < recording.position_m.size(); ++k) {
      const bool is_unsure = k % 3 == 0;
      recording.position_sd_m.push_back(is_unsure ? std::hypot(kSure, kUnsure) : kSure);
      if (is_unsure) recording.position_m[k] += noise(random);
    }
    const double mean_sd_m = sd_of_mean_weight(recording.position_sd_m);
    EXPECT_NEAR(mean_sd_m, kSure * std::sqrt(1.5), 1e-6);
    const Identification found = identify(recording, options);
    const Fit& fit = found.best;
    ASSERT_EQ(fit.end, SearchEnd::converged);
    EXPECT_TRUE(fit.residuals_are_white) << "weighed, all are alike";
    EXPECT_TRUE(found.warnings.empty()) << found.warnings.front();
    chi_square_per_value += fit.residual_sd * fit.residual_sd / (mean_sd_m * mean_sd_m) / kSeeds;
    recording.position_sd_m.clear();
    const Fit unweighed = identify(recording, options).best;
    for (const std::size_t i : {std::size_t{0}, std::size_t{1}, std::size_t{2}}) {
      EXPECT_LT(10 * fit.one_sigma[i].value(), unweighed.one_sigma[i].value()) << kParameterNames[i];
      const double sigmas = (values(fit.model)[i] - values(second_order)[i]) / fit.one_sigma[i].value();
      squares += sigmas * sigmas;
      ++parameters;
    }
  }
  EXPECT_LT(squares / parameters, 3) << "the sigmas are honest";
  EXPECT_NEAR(chi_square_per_value, 1, 0.07);
}

// A tenth of the positions is of a lost marker, metres off, and known to be: they hide no model that explains nothing.
TEST(ReferenceFit, APoorFitIsNamedHoweverFarUnsurePositionsLieApart) {
  Recording recording = watched(normalised(kNonNewtonianModel), {}, 3);
  std::mt19937 random{5};
  std::normal_distribution<double> noise{0, 2};
  for (std::size_t k = 0; k < recording.position_m.size(); ++k) {
    recording.position_sd_m.push_back(k % 10 == 0 ? 2 : 0.0005);
    if (k % 10 == 0) recording.position_m[k] += noise(random);
  }
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::first_order;
  options.further_starts = 0;
  EXPECT_GT(identify(recording, options).best.fit_percent, 80);
  for (double& duty : recording.duty) duty = -duty;
  const Identification turned = identify(recording, options);
  EXPECT_LT(turned.best.fit_percent, 50);
  using ::testing::HasSubstr;
  EXPECT_THAT(turned.warnings, ::testing::Contains(HasSubstr("turn one sign")));
}

TEST(ReferenceFit, ADoubtAboutWeighedPositionsSaysThatTheyAre) {
  Recording recording = watched(normalised(kNonNewtonianModel), {}, 3);
  recording.position_sd_m.assign(recording.position_m.size(), 0.0005);
  recording.position_m[500] += 0.1;
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::first_order;
  options.further_starts = 0;
  EXPECT_THAT(identify(recording, options).warnings,
              ::testing::Contains(::testing::HasSubstr(" m as weighed by position_sd_m) of the model")));
}

TEST(ReferenceFit, EqualSdsChangeNothing) {
  Recording recording = watched(kNonNewtonianModel, {}, 2);
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::second_order;
  options.further_starts = 0;
  const Fit without = identify(recording, options).best;
  recording.position_sd_m.assign(recording.position_m.size(), 0.004);
  const Fit with = identify(recording, options).best;
  EXPECT_NEAR(with.model.kp, without.model.kp, 1e-9 * without.model.kp);
  EXPECT_NEAR(with.residual_sd, without.residual_sd, 1e-9 * without.residual_sd);
}

TEST(ReferenceFit, ReadsThePositionBetweenTheTicks) {
  const std::vector<double> duty = prbs_duty(1, 0.5, 10, kTickS);
  const std::vector<double> fine_m = fine_positions(kNonNewtonianModel, duty);
  Eigen::VectorXd at_ticks(static_cast<Eigen::Index>(duty.size()));
  for (Eigen::Index k = 0; k < at_ticks.size(); ++k) at_ticks[k] = fine_m[static_cast<std::size_t>(10 * k)];
  std::vector<double> time_s;
  for (int k = 3; k < 9900; k += 7) time_s.push_back(0.001 * k);
  const PositionTimes times{time_s, kTickS};
  const Eigen::VectorXd read = times.read(at_ticks, 0.002), slope = times.slope(at_ticks, 0.002);
  const Eigen::VectorXd ahead = times.read(at_ticks, 0.002 + 1e-6), behind = times.read(at_ticks, 0.002 - 1e-6);
  for (Eigen::Index i = 0; i < read.size(); ++i) {
    const auto k = static_cast<std::size_t>(std::lround(1000 * time_s[static_cast<std::size_t>(i)])) + 2;
    EXPECT_NEAR(read[i], fine_m[k], 3e-6);
    EXPECT_NEAR(slope[i], (ahead[i] - behind[i]) / 2e-6, 2e-3);
  }
  EXPECT_EQ(PositionTimes({0.0}, kTickS).read(at_ticks, -0.1)[0], at_ticks[0]);
}

TEST(ReferenceFit, RefusesTimesThatCannotBe) {
  const Recording good = watched(kNonNewtonianModel, {}, 1);
  const auto refused = [&](auto spoil) {
    Recording bad = good;
    spoil(bad);
    try {
      identify(bad, {});
    } catch (const std::invalid_argument& error) {
      return std::string{error.what()};
    }
    return std::string{};
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(refused([](Recording& r) { r.position_time_s[7] = r.position_time_s[6]; }), HasSubstr("must ascend"));
  EXPECT_THAT(refused([](Recording& r) { r.position_time_s.back() = 40.5; }), HasSubstr("must lie in the record"));
  EXPECT_THAT(refused([](Recording& r) { r.position_m.pop_back(); }), HasSubstr("one per time"));
  EXPECT_THAT(refused([](Recording& r) { r.velocity_m_s = r.duty; }), HasSubstr("measured alone"));
  EXPECT_THAT(refused([](Recording& r) { r.position_sd_m = {0.001}; }), HasSubstr("position_sd_m has 1 values"));
  EXPECT_THAT(refused([](Recording& r) { r.position_sd_m.assign(r.position_m.size(), 0); }), HasSubstr("not positive"));
}

}  // namespace
}  // namespace control
