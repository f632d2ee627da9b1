// The measures of a step response follow the conventions of the reference closed-loop table.
#include "control/responses/step_metrics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <vector>

#include "control/models/modal_plant.hpp"

namespace control {
namespace {

constexpr double kSampleS = 0.01, kTargetM = 0.1, kDisturbanceM = -0.05, kDisturbedAtS = 20;

struct Trajectory {
  std::vector<double> time_s, position_m;
};

// The reference experiment in double: the golden recurrence, unsaturated memory, on the plant.
Trajectory run_reference(const nlohmann::json& golden, const FractionalModel& model, double duty_min, double duty_max) {
  const std::vector<double> b = golden["controller_b"], a = golden["controller_a"];
  std::vector<double> memory(b.size(), 0);  // direct form II transposed
  ModalPlant plant{model, kSampleS};
  Trajectory trajectory;
  for (int k = 0; k < 4000; ++k) {
    const double measured_m = plant.position_m() + (k >= 2000 ? kDisturbanceM : 0);
    trajectory.time_s.push_back(k * kSampleS);
    trajectory.position_m.push_back(measured_m);
    const double error_m = kTargetM - measured_m, duty = b[0] * error_m + memory[0];
    for (std::size_t i = 1; i < b.size(); ++i) {
      memory[i - 1] = b[i] * error_m - a[i] * duty + (i + 1 < b.size() ? memory[i] : 0);
    }
    plant.step(std::clamp(duty, duty_min, duty_max));
  }
  return trajectory;
}

void expect_metrics(const StepMetrics& metrics, const nlohmann::json& expected) {
  EXPECT_EQ(metrics.settling_s.has_value(), !expected["settling_2pct_s"].is_null());
  if (metrics.settling_s) EXPECT_NEAR(*metrics.settling_s, expected["settling_2pct_s"], 1e-6);
  EXPECT_NEAR(metrics.overshoot_percent, expected["overshoot_pct"], 1e-3);
  EXPECT_NEAR(metrics.peak_m, expected["peak"], 1e-6);
  ASSERT_TRUE(metrics.rise_10_90_s.has_value());
  EXPECT_NEAR(*metrics.rise_10_90_s, expected["rise_10_90_s"], 1e-6);
  EXPECT_NEAR(metrics.steady_state_error_m, expected["final_error"], 1e-6);
}

TEST(StepMetrics, ReproducesTheReferenceClosedLoopTable) {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/closed_loop_cases.json"));
  int checked = 0;
  for (const auto& row : golden["sampled"]) {
    if (row["recurrence_memory"] != "unsaturated") continue;
    SCOPED_TRACE(row["plant"].get<std::string>() + " " + row["duty_limits"].get<std::string>());
    const auto& model = row["plant"] == "Eq(29)" ? kNonNewtonianModel : kNewtonianModel;
    const double max = row["duty_limits"] == "none" ? 1e9 : 1, min = row["duty_limits"] == "0..1" ? 0 : -max;
    const Trajectory run = run_reference(golden, model, min, max);
    const StepExperiment step{0, kDisturbedAtS, 0, kTargetM, 0.002};
    const StepExperiment disturbance{kDisturbedAtS, 40, kTargetM + kDisturbanceM, kTargetM, 0.002};
    expect_metrics(measure_step(run.time_s, run.position_m, step), row["step"]);
    expect_metrics(measure_step(run.time_s, run.position_m, disturbance), row["disturbance"]);
    ++checked;
  }
  EXPECT_EQ(checked, 6);
}

TEST(StepMetrics, SaysThatItNeverSettledWhenTheLastSampleIsOutsideTheBand) {
  const std::vector<double> time_s{0, 1, 2, 3}, position_m{0, 0.1, 0.1, 0.11};
  EXPECT_FALSE(measure_step(time_s, position_m, {0, 10, 0, 0.1, 0.002}).settling_s.has_value());
  EXPECT_EQ(measure_step(time_s, position_m, {0, 3, 0, 0.1, 0.002}).settling_s, 1.0);
}

TEST(StepMetrics, MeasuresAStepBackwardsLikeOneForwards) {
  const std::vector<double> time_s{0, 1, 2, 3, 4}, position_m{0.1, 0.05, -0.01, 0, 0};
  const StepMetrics metrics = measure_step(time_s, position_m, {0, 10, 0.1, 0, 0.002});
  EXPECT_NEAR(metrics.overshoot_percent, 10, 1e-9);
  EXPECT_NEAR(metrics.peak_m, -0.01, 1e-12);
  EXPECT_EQ(metrics.settling_s, 3.0);
  EXPECT_EQ(metrics.rise_10_90_s, 1.0);
}

TEST(StepMetrics, IntegratesTheErrorByTheTrapezoidalRule) {
  const std::vector<double> time_s{1, 2, 4}, position_m{0, 0.1, 0.2}, duty{1, -0.5, 0};
  const StepMetrics metrics = measure_step(time_s, position_m, duty, {1, 10, 0, 0.1, 0.002});
  EXPECT_NEAR(metrics.iae_m_s, 0.05 + 0.1, 1e-12);
  EXPECT_NEAR(metrics.ise_m2_s, 0.005 + 0.01, 1e-12);
  EXPECT_NEAR(metrics.itae_m_s2, 0 + 0.3, 1e-12);
  EXPECT_EQ(metrics.peak_time_s, 3);
  EXPECT_EQ(metrics.duty_total_variation, 2.0);
  EXPECT_FALSE(measure_step(time_s, position_m, {1, 10, 0, 0.1, 0.002}).duty_total_variation.has_value());
}

TEST(StepMetrics, IntegralsOfAnExponentialAreThoseOfTheTextbook) {
  std::vector<double> time_s, position_m;
  for (int k = 0; k <= 3000; ++k) {
    time_s.push_back(k * kSampleS);
    position_m.push_back(1 - std::exp(-k * kSampleS));
  }
  const StepMetrics metrics = measure_step(time_s, position_m, {0, 100, 0, 1, 0.02});
  EXPECT_NEAR(metrics.iae_m_s, 1, 1e-4);
  EXPECT_NEAR(metrics.ise_m2_s, 0.5, 1e-4);
  EXPECT_NEAR(metrics.itae_m_s2, 1, 1e-4);
}

Trajectory with_noise(Trajectory run, double sd_m, std::uint64_t seed) {
  std::mt19937_64 generator{seed};
  std::normal_distribution<double> noise(0, sd_m);
  for (double& value : run.position_m) value += noise(generator);
  return run;
}

TEST(StepMetrics, OfANoisyRecordAreCloseToThoseOfTheCleanOne) {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/closed_loop_cases.json"));
  for (const auto& model : {kNonNewtonianModel, kNewtonianModel}) {
    const Trajectory clean = run_reference(golden, model, -1, 1);
    StepExperiment step{0, kDisturbedAtS, 0, kTargetM, 0.002};
    const StepMetrics exact = measure_step(clean.time_s, clean.position_m, step);
    for (const double sd_m : {0.05e-3, 0.2e-3, 0.5e-3, 1e-3}) {
      for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        SCOPED_TRACE(testing::Message() << model.kp << ", sd " << sd_m << ", seed " << seed);
        const Trajectory noisy = with_noise(clean, sd_m, seed);
        step.noise_sd_m = sd_m;
        const StepMetrics metrics = measure_step(noisy.time_s, noisy.position_m, step);
        ASSERT_TRUE(metrics.settling_s.has_value());
        // In water the last swing ends just inside the band, where noise decides by one swing.
        EXPECT_NEAR(*metrics.settling_s, *exact.settling_s, 0.02 + (model.kp == kNewtonianModel.kp ? 400 : 80) * sd_m);
        EXPECT_NEAR(metrics.overshoot_percent, exact.overshoot_percent, 0.45 + 900 * sd_m);  // the allowance
        EXPECT_NEAR(metrics.steady_state_error_m, exact.steady_state_error_m, 0.3 * sd_m);
        EXPECT_NEAR(*metrics.rise_10_90_s, *exact.rise_10_90_s, 0.03);
        EXPECT_NEAR(metrics.iae_m_s, exact.iae_m_s, 5 * sd_m);
      }
    }
  }
}

TEST(StepMetrics, SayThatANoisyRecordNeverSettledAndThatNoiseIsNoOvershoot) {
  Trajectory outside, inside;
  for (int k = 0; k < 2000; ++k) {
    for (Trajectory* run : {&outside, &inside}) run->time_s.push_back(k * kSampleS);
    outside.position_m.push_back(k < 100 ? 0.001 * k : 0.1033);
    inside.position_m.push_back(std::min(0.001 * k, 0.1));
  }
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const StepExperiment step{0, 20, 0, 0.1, 0.002, 0.5e-3};
    const Trajectory never = with_noise(outside, 0.5e-3, seed), exact = with_noise(inside, 0.5e-3, seed);
    EXPECT_FALSE(measure_step(never.time_s, never.position_m, step).settling_s.has_value());
    const StepMetrics metrics = measure_step(exact.time_s, exact.position_m, step);
    EXPECT_NEAR(metrics.settling_s.value(), 0.98, 0.1);
    EXPECT_LT(metrics.overshoot_percent, 1);
  }
}

TEST(StepMetrics, NeverCallsAnOscillationThroughTheBandSettled) {
  for (int phase = 0; phase < 60; ++phase) {
    Trajectory run;
    for (int k = 0; k < 2000; ++k) {
      run.time_s.push_back(k * kSampleS);
      run.position_m.push_back(k < 10 ? 0 : kTargetM + 0.01 * std::sin(4 * k * kSampleS + phase * 2 * 3.14159265 / 60));
    }
    EXPECT_FALSE(measure_step(run.time_s, run.position_m, {0, 20, 0, kTargetM, 0.002}).settling_s.has_value()) << phase;
  }
}

TEST(StepMetrics, WantTheLastTwentiethOfTheRecordInsideTheBand) {
  for (const int entered : {0, 500, 948, 952, 999}) {
    Trajectory run;
    for (int k = 0; k <= 1000; ++k) {
      run.time_s.push_back(k * kSampleS);
      run.position_m.push_back(k < entered ? 0 : kTargetM);
    }
    const StepMetrics metrics = measure_step(run.time_s, run.position_m, {0, 20, 0, kTargetM, 0.002});
    EXPECT_EQ(metrics.settling_s.has_value(), entered < 950) << entered;
  }
}

TEST(StepMetrics, GiveNoSettlingWhereTheNoiseIsAsWideAsTheBand) {
  Trajectory still;
  for (int k = 0; k < 4000; ++k) {
    still.time_s.push_back(k * kSampleS);
    still.position_m.push_back(std::min(0.001 * k, kTargetM));
  }
  StepExperiment step{0, 40, 0, kTargetM, 0.002};
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const double sd_m : {0.5e-3, 1e-3, 1.5e-3, 3e-3}) {
      const Trajectory noisy = with_noise(still, sd_m, seed);
      step.noise_sd_m = sd_m;
      const StepMetrics metrics = measure_step(noisy.time_s, noisy.position_m, step);
      EXPECT_EQ(metrics.settling_s.has_value(), sd_m <= 1e-3) << sd_m;
      if (metrics.settling_s) EXPECT_NEAR(*metrics.settling_s, 0.98, 0.15) << sd_m;
    }
  }
}

TEST(StepMetrics, RefusesRecordsThatAreNoStepResponse) {
  const std::vector<double> time_s{0, 1}, position_m{0, 0.1}, backwards{1, 0}, broken{0, std::nan("")}, short_m{0};
  const StepExperiment step{0, 10, 0, 0.1, 0.002};
  EXPECT_THROW(measure_step(time_s, short_m, step), std::invalid_argument);
  EXPECT_THROW(measure_step(backwards, position_m, step), std::invalid_argument);
  EXPECT_THROW(measure_step(time_s, broken, step), std::invalid_argument);
  EXPECT_THROW(measure_step(time_s, position_m, {0, 10, 0.1, 0.1, 0.002}), std::invalid_argument);
  EXPECT_THROW(measure_step(time_s, position_m, {0, 10, 0, 0.1, 0}), std::invalid_argument);
  EXPECT_THROW(measure_step(time_s, position_m, {5, 10, 0, 0.1, 0.002}), std::invalid_argument);
  EXPECT_THROW(measure_step(time_s, position_m, {0, 10, 0, 0.1, 0.002, -1}), std::invalid_argument);
  EXPECT_THROW(measure_step(time_s, position_m, short_m, step), std::invalid_argument);
}

}  // namespace
}  // namespace control
