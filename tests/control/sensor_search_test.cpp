// The sensor of a recorded acceleration: reads that failed count for nothing, and a search that is cut off says so.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "control/output_error_search.hpp"
#include "control/second_opinions.hpp"
#include "control/sensor_clock.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr double kPeriodS = 0.01;
constexpr FractionalModel kFluid{0.1, 0.006, 0.11, 1, 2, 1};

// Each tick reads a sample 0.75 ticks old, after a low pass. Of the reads at which the acceleration moves by more than
// `moves_by_m_s2` a share fails, and repeats the last one.
Recording acceleration_run(double duration_s, double noise_m_s2, double failed_share, double moves_by_m_s2 = 0) {
  Recording run{kPeriodS, prbs_duty(0.6, 0.2, duration_s, kPeriodS), {}, {}};
  const std::vector<double> exact = output_of(kFluid, Channel::acceleration, kPeriodS, run.duty);
  const Eigen::VectorXd felt_m_s2 = Eigen::Map<const Eigen::VectorXd>(exact.data(), std::ssize(exact));
  const SensorPath path({exact, std::vector<bool>(exact.size()), false}, kPeriodS);
  const Eigen::VectorXd readings = path.sampled(felt_m_s2, {-0.75 * kPeriodS, kPeriodS, 0.25 * kPeriodS});
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
  IdentificationOptions options;
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

}  // namespace
}  // namespace control
