// One sigma holds the truth about two times in three, whatever the noise and the cost; AIC and offset with dead time.
#include <gtest/gtest.h>

#include <numbers>

#include "control/search/fit_statistics.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

const FractionalModel kLag{0.1, 0, 0.2, 1, 2, 1};

void add_laplace_noise(std::vector<double>& values, double sd, unsigned seed) {
  std::mt19937 generator(seed);
  std::exponential_distribution<double> size(std::sqrt(2) / sd);
  std::bernoulli_distribution sign;
  for (double& value : values) value += sign(generator) ? size(generator) : -size(generator);
}

// Twice the seeds: of kp and of b2.
double covered_share(bool is_laplace, Cost cost, unsigned seeds) {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::first_order;
  options.further_starts = 0;
  options.cost = cost;
  const std::vector<double> duty = prbs_duty(1, 0.1, 2, 0.02);
  const Recording clean{0.02, duty, {}, output_of(kLag, Channel::velocity, 0.02, duty)};
  int covered = 0, all = 0;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    Recording run = clean;
    (is_laplace ? add_laplace_noise : add_noise)(run.velocity_m_s, 2e-3, seed);
    const Fit fit = identify(run, options).best;
    covered += std::abs(fit.model.kp - kLag.kp) < *fit.one_sigma[0] ? 1 : 0;
    covered += std::abs(fit.model.b2 - kLag.b2) < *fit.one_sigma[2] ? 1 : 0;
    all += 2;
  }
  return static_cast<double>(covered) / all;
}

TEST(IdentifyCoverage, OneSigmaHoldsTheTruthAboutTwoTimesInThree) {
  for (const bool is_laplace : {false, true}) {
    for (const Cost cost : {Cost::least_squares, Cost::absolute_error}) {
      const double share = covered_share(is_laplace, cost, 30);
      EXPECT_GT(share, 0.55) << is_laplace << ' ' << static_cast<int>(cost);
      EXPECT_LT(share, 0.8) << is_laplace << ' ' << static_cast<int>(cost);
    }
  }
}

// Gaussian: σ √(π/2); Laplacian: σ/√2.
TEST(IdentifyCoverage, TheScaleOfTheAbsoluteErrorIsThatOfTheDensityAtZero) {
  for (const std::size_t samples : {100U, 1000U, 10000U}) {
    double gaussian = 0, laplacian = 0;
    for (unsigned seed = 1; seed <= 30; ++seed) {
      std::vector<double> a(samples), b(samples);
      add_noise(a, 2, seed);
      add_laplace_noise(b, 2, seed);
      const auto of = [](const std::vector<double>& r) {
        return absolute_error_scale(Eigen::Map<const Eigen::VectorXd>(r.data(), std::ssize(r)), 0);
      };
      gaussian += of(a) / 30, laplacian += of(b) / 30;
    }
    EXPECT_NEAR(gaussian / (2 * std::sqrt(std::numbers::pi / 2)), 1, 0.1) << samples;
    EXPECT_NEAR(laplacian / (2 / std::sqrt(2)), 1, samples < 1000 ? 0.35 : 0.15) << samples;
  }
}

TEST(IdentifyCoverage, FindsDeadTimeAndOffsetTogether) {
  const std::vector<double> duty = prbs_duty(1, 0.2, 4, 0.01);
  Recording run{0.01, duty, output_of(kNonNewtonianModel, Channel::position, 0.01, duty, 0.0871), {}};
  for (double& x : run.position_m) x += 0.4;
  add_noise(run.position_m, 1e-5, 3);
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::fractional;
  options.further_starts = 0;
  options.longest_dead_time_s = 0.2;
  const Fit fit = identify(run, options).best;
  ASSERT_TRUE(fit.dead_time_sigma_s && fit.offset_sigma_m);
  EXPECT_EQ(fit.free_parameters, 7);
  EXPECT_NEAR(fit.model.dead_time_s, 0.0871, 4 * *fit.dead_time_sigma_s);
  EXPECT_NEAR(fit.offset_m, 0.4, 4 * *fit.offset_sigma_m);
  EXPECT_NEAR(fit.model.b2, 0.11031, 4 * *fit.one_sigma[2]);
}

TEST(IdentifyCoverage, AicIsTheSumOverTheChannels) {
  const std::vector<double> duty = prbs_duty(1, 0.2, 3, 0.01);
  Recording run = position_run(kLag, duty, 1e-4, 5);
  run.velocity_m_s = output_of(kLag, Channel::velocity, 0.01, duty);
  add_noise(run.velocity_m_s, 2e-2, 6);
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::first_order;
  const Fit fit = identify(run, options).best;
  const auto mean_square = [](const std::vector<double>& residual) {
    double sum = 0;
    for (const double r : residual) sum += r * r;
    return sum / static_cast<double>(residual.size());
  };
  const double n = 301;
  EXPECT_NEAR(mean_square(fit.position_residual_m), 1e-8, 2e-9);
  EXPECT_NEAR(
      fit.aic,
      n * std::log(mean_square(fit.position_residual_m)) + n * std::log(mean_square(fit.velocity_residual_m_s)) + 2 * 3,
      1e-6 * std::abs(fit.aic));
  EXPECT_EQ(fit.free_parameters, 3);  // kp, b2 and the offset
}

}  // namespace
}  // namespace control
