// Predicted experiments agree with the reference trajectories, and respond to profile and noise as they should.
#include "control/responses/closed_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace control {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

nlohmann::json golden() { return nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/closed_loop_cases.json")); }

ParallelSections reference_controller() {
  const auto reference = golden();
  return to_parallel_sections({reference["controller_b"], reference["controller_a"], 0.01});
}

ClosedLoopExperiment experiment(const FractionalModel& plant, double duty_min = -1, double duty_max = 1) {
  ClosedLoopExperiment result;
  result.plant = plant;
  result.controller = reference_controller();
  result.duty_min = duty_min;
  result.duty_max = duty_max;
  return result;
}

void expect_metrics(const StepMetrics& metrics, const nlohmann::json& expected) {
  EXPECT_EQ(metrics.settling_s.has_value(), !expected["settling_2pct_s"].is_null());
  if (metrics.settling_s) EXPECT_NEAR(*metrics.settling_s, expected["settling_2pct_s"], 1e-6);
  EXPECT_NEAR(metrics.overshoot_percent, expected["overshoot_pct"], 1e-3);
  EXPECT_NEAR(metrics.peak_m, expected["peak"], 1e-6);
  ASSERT_TRUE(metrics.rise_10_90_s.has_value());
  EXPECT_NEAR(*metrics.rise_10_90_s, expected["rise_10_90_s"], 1e-6);
  EXPECT_NEAR(metrics.steady_state_error_m, expected["final_error"], 1e-6);
  EXPECT_TRUE(metrics.duty_total_variation.has_value());
}

TEST(ClosedLoop, FollowsTheReferenceTrajectories) {
  const auto reference = golden();
  int checked = 0;
  for (const auto& row : reference["sampled"]) {
    if (row["recurrence_memory"] != "unsaturated") continue;
    SCOPED_TRACE(row["plant"].get<std::string>() + " " + row["duty_limits"].get<std::string>());
    const auto& plant = row["plant"] == "Eq(29)" ? kNonNewtonianModel : kNewtonianModel;
    const double max = row["duty_limits"] == "none" ? kUnlimited : 1, min = row["duty_limits"] == "0..1" ? 0 : -max;
    const ClosedLoopPrediction prediction = predict_closed_loop(experiment(plant, min, max));
    ASSERT_EQ(prediction.time_s.size(), 4001U);
    for (std::size_t i = 0; i < row["k"].size(); ++i) {
      const std::size_t k = row["k"][i];
      ASSERT_NEAR(prediction.measured_m[k], row["measured"][i], 1e-6) << k;
      ASSERT_NEAR(prediction.duty[k], row["duty"][i], 2e-4) << k;
    }
    expect_metrics(prediction.step, row["step"]);
    expect_metrics(prediction.disturbance, row["disturbance"]);
    EXPECT_EQ(prediction.clipped_fraction > 0, max == 1);
    ++checked;
  }
  EXPECT_EQ(checked, 6);
}

TEST(ClosedLoop, OvershootsWaterTenTimesLessWithALimitedReference) {
  ClosedLoopExperiment limited = experiment(kNewtonianModel);
  limited.profile_velocity_m_s = 0.06;
  limited.profile_acceleration_m_s2 = 0.25;
  const double plain = predict_closed_loop(experiment(kNewtonianModel)).step.overshoot_percent;
  const ClosedLoopPrediction prediction = predict_closed_loop(limited);
  EXPECT_NEAR(plain, 9.8, 0.1);
  EXPECT_NEAR(prediction.step.overshoot_percent, 1, 0.3);
  EXPECT_GT(prediction.disturbance.overshoot_percent, 15);  // which no reference can help
  EXPECT_EQ(prediction.reference_m.front(), 0);
  EXPECT_EQ(prediction.reference_m.back(), 0.1);
}

TEST(ClosedLoop, PassesMeasurementNoiseToTheDutyAsTheReferenceTableSays) {
  ClosedLoopExperiment noisy = experiment(kNonNewtonianModel);
  noisy.noise_sd_m = 0.2e-3;
  noisy.duration_s = noisy.disturbance_at_s = 200;  // the last quarter of it is 5000 samples
  const ClosedLoopPrediction prediction = predict_closed_loop(noisy);
  EXPECT_NEAR(prediction.duty_sd_at_rest, 129 * noisy.noise_sd_m, 0.05 * 129 * noisy.noise_sd_m);
  EXPECT_EQ(prediction.duty, predict_closed_loop(noisy).duty);
  noisy.noise_seed = 2;
  EXPECT_NE(prediction.duty, predict_closed_loop(noisy).duty);
  EXPECT_LT(predict_closed_loop(experiment(kNonNewtonianModel)).duty_sd_at_rest, 2e-5);
}

TEST(ClosedLoop, LeavesOutTheMeasuresOfWhatDoesNotHappen) {
  ClosedLoopExperiment quiet = experiment(kNonNewtonianModel);
  quiet.disturbance_at_s = 100;
  EXPECT_FALSE(predict_closed_loop(quiet).disturbance.settling_s.has_value());
  EXPECT_TRUE(predict_closed_loop(quiet).step.settling_s.has_value());
  quiet.setpoint_m = 0;
  quiet.disturbance_at_s = 1;
  EXPECT_FALSE(predict_closed_loop(quiet).step.settling_s.has_value());
  EXPECT_TRUE(predict_closed_loop(quiet).disturbance.settling_s.has_value());
}

TEST(ClosedLoop, EndsTheRecordOfALoopThatDiverges) {
  ClosedLoopExperiment wild = experiment(kNonNewtonianModel, -kUnlimited, kUnlimited);
  for (const double gain : {1.0, 100.0, 1e300}) {
    SCOPED_TRACE(gain);
    wild.plant.kp = gain;
    const ClosedLoopPrediction prediction = predict_closed_loop(wild);
    EXPECT_TRUE(prediction.is_diverging);
    EXPECT_LT(prediction.time_s.size(), 4001U);
    EXPECT_EQ(prediction.time_s.size(), prediction.measured_m.size());
    EXPECT_GT(std::abs(prediction.measured_m.back()), 100);
    EXPECT_FALSE(prediction.step.settling_s.has_value());
    EXPECT_FALSE(prediction.disturbance.settling_s.has_value());
  }
  wild.duty_min = -1;
  wild.duty_max = 1;
  wild.plant.kp = 1;
  EXPECT_FALSE(predict_closed_loop(wild).is_diverging);  // the clamp holds it in a limit cycle
  EXPECT_FALSE(predict_closed_loop(experiment(kNonNewtonianModel)).is_diverging);
}

TEST(ClosedLoop, RefusesExperimentsOutsideTheirRange) {
  const auto refuses = [](auto change) {
    ClosedLoopExperiment e = experiment(kNonNewtonianModel);
    change(e);
    EXPECT_THROW(predict_closed_loop(e), std::invalid_argument);
  };
  refuses([](auto& e) { e.period_s = 0; });
  refuses([](auto& e) { e.duration_s = -1; });
  refuses([](auto& e) { e.duration_s = 1e9; });
  refuses([](auto& e) { e.setpoint_m = std::nan(""); });
  refuses([](auto& e) { e.duty_min = 0.1; });
  refuses([](auto& e) { e.duty_max = 0; });
  refuses([](auto& e) { e.noise_sd_m = -1; });
  refuses([](auto& e) { e.profile_velocity_m_s = -1; });
  refuses([](auto& e) { e.plant.b2 = 0; });
  refuses([](auto& e) { e.duration_s = 1.1e6 * e.period_s; });
}

}  // namespace
}  // namespace control
