// A drift under noise makes sigmas too small and is named, with the factor; white noise is not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "control/search/fit_statistics.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

constexpr double kTick_s = 0.01, kNoise_m = 1e-3;
constexpr FractionalModel kSlowLag{0.1, 0, 0.2, 1, 2, 1};

// With a correlation time, and begun in its steady state.
std::vector<double> drift(std::size_t samples, double sd, double time_s, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  const double kept = std::exp(-kTick_s / time_s);
  std::vector<double> values{sd * normal(random)};
  while (values.size() < samples)
    values.push_back(kept * values.back() + sd * std::sqrt(1 - kept * kept) * normal(random));
  return values;
}

Recording run_with_drift(double drift_m, unsigned seed) {
  Recording run = position_run(kSlowLag, prbs_duty(0.5, 0.5, 120, kTick_s), kNoise_m, seed);
  const std::vector<double> more = drift(run.duty.size(), drift_m, 10, 1000 + seed);
  for (std::size_t k = 0; k < more.size(); ++k) run.position_m[k] += more[k];
  return run;
}

struct Tally {
  int runs = 0, white = 0, named = 0;
  double factors = 0, squares_of_z = 0;
};

Tally identified(double drift_m) {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::first_order;
  options.further_starts = 0;
  Tally tally;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Identification found = identify(run_with_drift(drift_m, seed), options);
    const bool is_named = std::ranges::any_of(found.warnings, [](const std::string& warning) {
      return warning.starts_with("the residuals of position_m drift: ");
    });
    EXPECT_EQ(is_named, found.best.residuals_are_white && found.best.drift_factor > 1);
    ++tally.runs;
    tally.white += found.best.residuals_are_white ? 1 : 0;
    tally.named += is_named ? 1 : 0;
    tally.factors += found.best.drift_factor;
    tally.squares_of_z += std::pow((found.best.model.kp - kSlowLag.kp) / *found.best.one_sigma[0], 2);
  }
  return tally;
}

TEST(ResidualDrift, IsNotSeenInWhiteNoise) {
  int seen = 0;
  for (unsigned seed = 1; seed <= 300; ++seed) {
    std::vector<double> noise(6000);
    add_noise(noise, 1, seed);
    seen += drift_factor(Eigen::Map<const Eigen::VectorXd>(noise.data(), std::ssize(noise)), 200) > 1 ? 1 : 0;
  }
  EXPECT_LE(seen, 3);
  const Tally tally = identified(0);
  EXPECT_EQ(tally.named, 0);
  EXPECT_LT(std::sqrt(tally.squares_of_z / tally.runs), 1.4);
}

TEST(ResidualDrift, IsNamedWithTheFactorWhereTheWhitenessOfShortLagsDoesNotShowIt) {
  const Tally tally = identified(0.1 * kNoise_m);
  EXPECT_GE(tally.white, 10) << "at short lags";
  EXPECT_GE(tally.named, tally.white - 4);
  const double rms_z = std::sqrt(tally.squares_of_z / tally.runs), factor = tally.factors / tally.runs;
  EXPECT_GT(rms_z, 1.3) << "the sigmas are too small";
  EXPECT_GT(factor, 1.3);
  EXPECT_LT(rms_z / factor, 2);
  EXPECT_GT(rms_z / factor, 0.5);
}

// Less than ten means say nothing.
TEST(ResidualDrift, IsNotLookedForInAShortRecord) {
  const std::vector<double> slow = drift(1900, 1, 10, 3);
  EXPECT_EQ(drift_factor(Eigen::Map<const Eigen::VectorXd>(slow.data(), std::ssize(slow)), 200), 1);
}

}  // namespace
}  // namespace control
