// What the sigmas of a plant make of a margin, against the margins of drawn plants.
#include "control/tuning/margin_uncertainty.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "control/responses/frequency_response.hpp"
#include "control/tuning/tune.hpp"

namespace control {
namespace {

ExpectedUncertainty a_fit_of(const FractionalModel& plant) {
  ExpectedUncertainty known{{0.01 * plant.kp, 0.03 * plant.b1, 0.02 * plant.b2, 0.01, 0.005}, {}};
  for (std::size_t i = 0; i < kParameters; ++i) known.correlation[i][i] = 1;
  const auto correlate = [&](std::size_t i, std::size_t j, double by) {
    known.correlation[i][j] = known.correlation[j][i] = by;
  };
  correlate(1, 3, 0.9), correlate(2, 4, -0.6), correlate(0, 2, 0.5);
  return known;
}

Eigen::MatrixXd covariance_of(const ExpectedUncertainty& known) {
  Eigen::MatrixXd covariance(kParameters, kParameters);
  for (std::size_t i = 0; i < kParameters; ++i) {
    for (std::size_t j = 0; j < kParameters; ++j) {
      covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          known.correlation[i][j] * *known.one_sigma[i] * *known.one_sigma[j];
    }
  }
  return covariance;
}

class Spread {
 public:
  void add(double value) { sum_ += value, squares_ += value * value, ++count_; }
  double sd() const { return std::sqrt(squares_ / count_ - sum_ * sum_ / count_ / count_); }

 private:
  double sum_ = 0, squares_ = 0, count_ = 0;
};

void expect_spread_of_draws(const OpenLoop& loop, double dead_time_sd_s = 0) {
  const Margins middle = margins(loop);
  ExpectedUncertainty known = a_fit_of(loop.plant);
  known.dead_time_sd_s = dead_time_sd_s;
  const Eigen::MatrixXd root = covariance_of(known).llt().matrixL();
  std::mt19937 random{4};
  std::normal_distribution<double> normal;
  Spread margin_deg, crossover_rad_s, slope_deg_s;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::VectorXd by = root * Eigen::VectorXd::NullaryExpr(5, [&] { return normal(random); });
    OpenLoop drawn = loop;
    drawn.plant.kp += by[0], drawn.plant.b1 += by[1], drawn.plant.b2 += by[2];
    drawn.plant.alpha += by[3], drawn.plant.beta += by[4];
    if (dead_time_sd_s > 0) drawn.plant.dead_time_s += dead_time_sd_s * normal(random);
    const Margins found = margins(drawn);
    margin_deg.add(*found.phase_margin_deg - *middle.phase_margin_deg);
    crossover_rad_s.add(*found.gain_crossover_rad_s - *middle.gain_crossover_rad_s);
    slope_deg_s.add(*found.phase_slope_deg_per_rad_s - *middle.phase_slope_deg_per_rad_s);
  }
  const MarginUncertainty sd = margin_uncertainty(loop, *middle.gain_crossover_rad_s, known);
  EXPECT_NEAR(sd.phase_margin_deg / margin_deg.sd(), 1, 0.07);
  EXPECT_NEAR(sd.gain_crossover_rad_s / crossover_rad_s.sd(), 1, 0.07);
  EXPECT_NEAR(sd.phase_slope_deg_per_rad_s / slope_deg_s.sd(), 1, 0.07);
}

TEST(MarginUncertainty, IsTheSpreadOverPlantsThatAreDrawn) {
  expect_spread_of_draws({kNonNewtonianModel, kPaperController, false});
  expect_spread_of_draws({kNonNewtonianModel, kPaperController, true});
  FractionalModel late = kNonNewtonianModel;
  late.dead_time_s = 0.05;
  const OpenLoop loop{late, tune(late, {3, 80, 0.8, false}).tuned->controller, false};
  expect_spread_of_draws(loop);
  expect_spread_of_draws(loop, 0.01);
  expect_spread_of_draws({kNonNewtonianModel, tune(kNonNewtonianModel, {3, 90}).tuned->controller, false});
}

// That is what iso-damping is for.
TEST(MarginUncertainty, AnErrorOfTheGainMovesTheCrossoverOfAnIsoDampedLoopAndNotItsMargin) {
  const FopdController controller = tune(kNonNewtonianModel, {3, 90, {}, false}).tuned->controller;
  ExpectedUncertainty known;
  known.one_sigma[0] = 0.1 * kNonNewtonianModel.kp;
  const MarginUncertainty sd = margin_uncertainty({kNonNewtonianModel, controller, false}, 3, known);
  EXPECT_NEAR(sd.phase_margin_deg, 0, 1e-9);
  EXPECT_GT(sd.gain_crossover_rad_s, 0.2);
  EXPECT_LT(sd.gain_crossover_rad_s, 0.5);
}

}  // namespace
}  // namespace control
