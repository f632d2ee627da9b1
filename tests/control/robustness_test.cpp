// The robustness table says of the paper's controller what is known of it.
#include "control/tuning/robustness.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace control {
namespace {

const RobustnessRow& row(const RobustnessTable& table, const std::string& name, double duty_min) {
  for (const auto& candidate : table.rows) {
    if (candidate.name == name && candidate.duty_min == duty_min) return candidate;
  }
  throw std::out_of_range(name);
}

Discretisation reference_discretisation() {
  Discretisation result = discretise(kPaperController, {});
  result.sections.direct += result.dc_gain_before - result.dc_gain;  // as the reference is: not corrected
  return result;
}

TEST(Robustness, ReproducesTheKnownTableForThePapersController) {
  const RobustnessTable table = robustness(kNonNewtonianModel, reference_discretisation());
  ASSERT_EQ(table.rows.size(), 8U);
  EXPECT_NEAR(row(table, "as modelled", -1).step.overshoot_percent, 0.45, 0.005);
  EXPECT_NEAR(row(table, "as modelled", -1).step.settling_s.value(), 1.15, 0.005);
  EXPECT_NEAR(row(table, "water (28)", -1).step.overshoot_percent, 9.82, 0.005);
  EXPECT_NEAR(row(table, "water (28)", -1).step.settling_s.value(), 0.84, 0.005);
  EXPECT_NEAR(row(table, "gain -30 %", -1).step.overshoot_percent, 0.06, 0.005);
  EXPECT_NEAR(row(table, "gain +30 %", -1).step.overshoot_percent, 1.46, 0.005);
  EXPECT_NEAR(row(table, "water (28)", -1).disturbance.overshoot_percent, 20.1, 0.05);
  EXPECT_NEAR(table.duty_sd_per_noise_sd.value(), 129, 0.5);
}

TEST(Robustness, ShowsThatAMotorThatCannotReverseLeavesItsOvershootForEver) {
  const RobustnessTable table = robustness(kNonNewtonianModel, reference_discretisation());
  EXPECT_FALSE(row(table, "as modelled", 0).step.settling_s.has_value());
  EXPECT_NEAR(row(table, "as modelled", 0).step.steady_state_error_m, -3.29e-3, 1e-5);
  EXPECT_FALSE(row(table, "water (28)", 0).step.settling_s.has_value());
  EXPECT_NEAR(row(table, "water (28)", 0).step.steady_state_error_m, -20.5e-3, 5e-5);
}

// The other sets of the table: kp, kd, mu; overshoot and settling in both fluids; duty sd per m of noise sd.
struct KnownSet {
  FopdController controller;
  double overshoot, settling_s, water_overshoot, water_settling_s, noise;
};

TEST(Robustness, AgreesWithTheKnownTableForTheOtherSets) {
  const std::vector<KnownSet> sets{{{29.971237, 0.10523527, 0.94550043}, 0.09, 1.77, 0, 0.77, 697},
                                   {{51.470, 0.067554, 0.9}, 0.13, 1.33, 0, 0.45, 601},
                                   {{30.701, 0.048465, 0.8}, 0.13, 1.52, 2.92, 0.55, 155}};
  for (const auto& set : sets) {
    SCOPED_TRACE(set.controller.kp);
    const RobustnessTable table = robustness(kNonNewtonianModel, discretise(set.controller, {}));
    EXPECT_NEAR(row(table, "as modelled", -1).step.overshoot_percent, set.overshoot, 0.1);
    EXPECT_NEAR(row(table, "as modelled", -1).step.settling_s.value(), set.settling_s, 0.025);
    EXPECT_NEAR(row(table, "water (28)", -1).step.overshoot_percent, set.water_overshoot, 0.15);
    EXPECT_NEAR(row(table, "water (28)", -1).step.settling_s.value(), set.water_settling_s, 0.025);
    EXPECT_NEAR(table.duty_sd_per_noise_sd.value(), set.noise, 0.05 * set.noise);
  }
}

FractionalModel times(FractionalModel plant, double gain) {
  plant.kp *= gain;
  return plant;
}

TEST(Robustness, SaysWhichLoopsAreUnstableAndGivesThemNoNoiseGain) {
  const RobustnessTable good = robustness(kNonNewtonianModel, reference_discretisation());
  for (const auto& each : good.rows) {
    EXPECT_TRUE(each.is_stable) << each.name;
    EXPECT_FALSE(each.is_diverging) << each.name;
  }
  for (const double gain : {10.0, 30.0, 100.0, -1.0}) {
    SCOPED_TRACE(gain);
    const RobustnessTable table = robustness(times(kNonNewtonianModel, gain), reference_discretisation());
    EXPECT_FALSE(table.duty_sd_per_noise_sd.has_value());
    EXPECT_FALSE(row(table, "as modelled", -1).is_stable);
    EXPECT_TRUE(row(table, "water (28)", -1).is_stable);
  }
}

TEST(Robustness, IsNotFooledByFewSamples) {
  DiscretisationOptions slow;
  slow.method = DiscretisationMethod::oustaloup;
  slow.period_s = 1;
  const RobustnessTable table = robustness(kNonNewtonianModel, discretise(kPaperController, slow));
  EXPECT_FALSE(table.duty_sd_per_noise_sd.has_value());
  EXPECT_FALSE(row(table, "as modelled", -1).is_stable);
  const RobustnessTable gentle = robustness(kNonNewtonianModel, discretise({1, 0.0305, 0.6524}, slow));
  EXPECT_TRUE(gentle.duty_sd_per_noise_sd.has_value());
  EXPECT_TRUE(row(gentle, "as modelled", -1).is_stable);
}

TEST(Robustness, RefusesAPlantOutsideItsRange) {
  EXPECT_THROW(robustness(FractionalModel{0.1, -1, 1, 1, 1.5, 0.5}, reference_discretisation()), std::invalid_argument);
}

}  // namespace
}  // namespace control
