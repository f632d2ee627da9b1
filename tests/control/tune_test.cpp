// Tuned controllers meet what was asked for, or say why none can.
#include "control/tuning/tune.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>

#include "control/responses/frequency_response.hpp"

namespace control {
namespace {

using testing::HasSubstr;

constexpr double kPrinted = 1e-6;  // relative, where the reference has 10 digits or more

nlohmann::json golden() { return nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/tuning_solutions.json")); }

TuningSpec spec_of(const nlohmann::json& row, bool is_velocity_loop) {
  return {row["w_gc"], row["phi_m"], std::nullopt, is_velocity_loop};
}

void expect_relative(double value, double expected, double tolerance) {
  EXPECT_NEAR(value / expected, 1, tolerance) << value << " instead of " << expected;
}

void expect_controller(const FopdController& controller, const nlohmann::json& row, double tolerance) {
  expect_relative(controller.kp, row["kp"], tolerance);
  expect_relative(controller.kd, row["kd"], tolerance);
  expect_relative(controller.mu, row["mu"], tolerance);
}

// The crossover that was asked for is there, with its phase margin, and no other one has a smaller margin.
void expect_achieved(const FractionalModel& plant, const TunedController& design) {
  const OpenLoop loop{plant, design.controller, design.spec.is_velocity_loop};
  const Margins achieved = margins(loop);
  expect_relative(achieved.gain_crossover_rad_s.value_or(0), design.spec.gain_crossover_rad_s, 1e-9);
  EXPECT_NEAR(achieved.phase_margin_deg.value_or(0), design.spec.phase_margin_deg, 1e-7) << design.name;
  EXPECT_TRUE(achieved.is_closed_loop_stable) << design.name;
}

void expect_iso_damped(const FractionalModel& plant, const TunedController& design) {
  const OpenLoop loop{plant, design.controller, design.spec.is_velocity_loop};
  const double asked = design.spec.gain_crossover_rad_s;
  EXPECT_NEAR(open_loop_phase_slope_s(loop, asked) * asked, 0, 1e-9) << design.name;
}

const TunedController* find(const std::vector<TunedController>& designs, const char* words) {
  const auto found = std::ranges::find_if(
      designs, [words](const TunedController& design) { return design.name.find(words) != std::string::npos; });
  return found == designs.end() ? nullptr : &*found;
}

TEST(Tune, IsoDampedControllersAreTheReference) {
  const auto reference = golden();
  for (const auto& [list, is_velocity_loop] : {std::pair{"exact_isodamped", false}, {"velocity_plant_exact", true}}) {
    for (const auto& row : reference[list]) {
      SCOPED_TRACE(row.dump());
      const TuningResult result = tune(kNonNewtonianModel, spec_of(row, is_velocity_loop));
      ASSERT_TRUE(result.is_feasible);
      EXPECT_TRUE(result.reason.empty() && result.nearest.empty() && result.relaxed.empty());
      expect_controller(result.tuned->controller, row, kPrinted);
      expect_achieved(kNonNewtonianModel, *result.tuned);
      expect_iso_damped(kNonNewtonianModel, *result.tuned);
      if (row.contains("Ms")) expect_relative(result.tuned->achieved.ms, row["Ms"], kPrinted);
      if (row.contains("Mt")) expect_relative(result.tuned->achieved.mt, row["Mt"], kPrinted);
    }
  }
}

TEST(Tune, ControllersOfFixedMuAreTheReference) {
  const auto reference = golden();
  for (const auto& [list, is_velocity_loop] :
       {std::pair{"relaxed_no_isodamping", false}, {"velocity_plant_65_72_relaxed", true}}) {
    for (const auto& row : reference[list]) {
      SCOPED_TRACE(row.dump());
      TuningSpec spec = spec_of(row, is_velocity_loop);
      spec.mu = row["mu"];
      const TuningResult result = tune(kNonNewtonianModel, spec);
      ASSERT_TRUE(result.is_feasible);
      expect_controller(result.tuned->controller, row, kPrinted);
      expect_achieved(kNonNewtonianModel, *result.tuned);
      if (!row.contains("Ms")) continue;
      expect_relative(result.tuned->achieved.ms, row["Ms"], kPrinted);
      EXPECT_NEAR(*result.tuned->achieved.phase_slope_deg_per_rad_s, row["dphase_deg_per_radps"], 1e-6);
    }
  }
}

TEST(Tune, SixRadPerSAnd65DegreesGiveThePapersController) {
  const TuningResult result = tune(kNonNewtonianModel, {6, 65, 0.6524});
  ASSERT_TRUE(result.is_feasible);
  expect_relative(result.tuned->controller.kp, kPaperController.kp, 1e-3);
  expect_relative(result.tuned->controller.kd, kPaperController.kd, 1e-3);
  EXPECT_EQ(result.tuned->controller.mu, 0.6524);
  EXPECT_THAT(result.tuned->name, HasSubstr("iso-damping dropped"));
}

TEST(Tune, RefusesThePapersSpecificationAndSaysWhy) {
  const auto expected = golden()["paper_spec"]["solutions_if_mu_may_exceed_1"]["position_plant"];
  const TuningResult result = tune(kNonNewtonianModel, {65, 72});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_FALSE(result.tuned);
  EXPECT_NEAR(result.theta_deg, 107.22, 5e-3);
  EXPECT_THAT(result.reason, HasSubstr("theta = 107.222 degrees"));
  EXPECT_THAT(result.reason, HasSubstr("less than 90"));
  ASSERT_EQ(result.relaxed.size(), 1u);  // 107 degrees are out of reach for mu up to 1
  EXPECT_THAT(result.relaxed[0].name, HasSubstr("mu > 1"));
  expect_relative(result.relaxed[0].controller.kp, expected["kp"], 1e-8);
  EXPECT_NEAR(result.relaxed[0].controller.kd, expected["kd"], 5e-8);
  EXPECT_NEAR(result.relaxed[0].controller.mu, expected["mu"], 5e-7);
  expect_iso_damped(kNonNewtonianModel, result.relaxed[0]);
}

TEST(Tune, RefusesThePapersSpecificationOnTheVelocityPlantToo) {
  const auto expected = golden()["paper_spec"]["solutions_if_mu_may_exceed_1"]["velocity_plant"];
  const TuningResult result = tune(kNonNewtonianModel, {65, 72, std::nullopt, true});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_NEAR(result.theta_deg, 17.22, 5e-3);
  EXPECT_NEAR(result.phase_fall, 0.45243, 5e-6);
  EXPECT_THAT(result.reason, HasSubstr("R = 0.452425"));
  EXPECT_THAT(result.reason, HasSubstr("sin(2 theta)/2 = 0.282796"));
  const TunedController* mu_above_1 = find(result.relaxed, "mu > 1");
  ASSERT_TRUE(mu_above_1);
  EXPECT_NEAR(mu_above_1->controller.kp, expected["kp"], 5e-5);
  EXPECT_NEAR(mu_above_1->controller.kd, expected["kd"], 5e-7);
  EXPECT_NEAR(mu_above_1->controller.mu, expected["mu"], 5e-7);
  EXPECT_TRUE(find(result.relaxed, "mu fixed at 0.9"));
  const TunedController* flattest = find(result.relaxed, "flattest");
  ASSERT_TRUE(flattest);
  EXPECT_EQ(flattest->controller.mu, 1);
}

TEST(Tune, OffersTheNearestSpecificationsThatHaveASolution) {
  const TuningResult result = tune(kNonNewtonianModel, {65, 72, std::nullopt, true});
  const TunedController* same_crossover = find(result.nearest, "nearest phase margin");
  ASSERT_TRUE(same_crossover);
  EXPECT_EQ(same_crossover->spec.gain_crossover_rad_s, 65);
  const auto range = feasible_phase_margins(kNonNewtonianModel, 65, true);
  EXPECT_NEAR(same_crossover->spec.phase_margin_deg, range->low_deg + 0.1, 1e-9);
  const TunedController* above = find(result.nearest, "crossover above");
  ASSERT_TRUE(above);
  expect_relative(above->spec.gain_crossover_rad_s, golden()["velocity_plant_phi72_solvable_from_w_gc"], 2e-3);
  EXPECT_GT(above->spec.gain_crossover_rad_s, golden()["velocity_plant_phi72_solvable_from_w_gc"]);
  for (const TunedController& design : result.nearest) {
    EXPECT_TRUE(tune(kNonNewtonianModel, design.spec).is_feasible) << design.name;
    expect_achieved(kNonNewtonianModel, design);
    expect_iso_damped(kNonNewtonianModel, design);
    EXPECT_LT(design.controller.mu, 1);
  }
}

TEST(Tune, OffersNoPhaseMarginInTheBandWithoutIsoDamping) {
  const TuningResult result = tune(kNonNewtonianModel, {20, 95});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_GT(result.phase_fall, 0.5);
  EXPECT_FALSE(find(result.nearest, "nearest phase margin"));
  const TunedController* below = find(result.nearest, "crossover below");
  ASSERT_TRUE(below);
  EXPECT_LT(below->spec.gain_crossover_rad_s, golden()["R_half_crossings"][0].get<double>());
}

TEST(Tune, SaysThatThePlantHasMorePhaseThanAskedFor) {
  for (const std::optional<double> mu : {std::optional<double>{}, {0.9}}) {
    const TuningResult result = tune(kNonNewtonianModel, {5, 45, mu});
    EXPECT_FALSE(result.is_feasible);
    EXPECT_LT(result.theta_deg, 0);
    EXPECT_THAT(result.reason, HasSubstr("more than the 45 asked for"));
    EXPECT_TRUE(result.relaxed.empty());
    EXPECT_TRUE(find(result.nearest, "nearest phase margin"));
  }
}

TEST(Tune, SaysWhichMuWouldDo) {
  const TuningResult result = tune(kNonNewtonianModel, {5, 91, 0.1});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_THAT(result.reason, HasSubstr("with mu = 0.1 it adds less than 9"));
  EXPECT_THAT(result.reason, HasSubstr("a mu above"));
  const TunedController* iso_damped = find(result.relaxed, "iso-damped");
  ASSERT_TRUE(find(result.relaxed, "mu left free: iso-damped"));
  expect_iso_damped(kNonNewtonianModel, *find(result.relaxed, "mu left free: iso-damped"));
  EXPECT_TRUE(iso_damped);
  for (const TunedController& design : result.nearest) {
    EXPECT_EQ(design.controller.mu, 0.1);
    expect_achieved(kNonNewtonianModel, design);
  }
}

// A resonant plant: at 5 rad/s everything is as asked for, and far above it the gain is 1 again with a negative margin.
TEST(Tune, RefusesASolutionWhoseLoopIsUnstableAndSaysWhichCrossoverRulesIt) {
  const FractionalModel plant{0.4, 0.01, 0.02, 1, 1.9, 0.5};
  const TuningResult result = tune(plant, {5, 100});
  EXPECT_FALSE(result.is_feasible);
  EXPECT_FALSE(result.tuned);
  ASSERT_TRUE(result.refused);
  const Margins& refused = result.refused->achieved;
  EXPECT_NEAR(*refused.phase_margin_deg, -22.96, 5e-3);
  EXPECT_FALSE(refused.is_closed_loop_stable);
  EXPECT_NEAR(180 + open_loop_phase_rad({plant, result.refused->controller}, 5) * kDegPerRad, 100, 1e-7);
  EXPECT_THAT(result.reason, HasSubstr("but the closed loop is unstable: the gain is 1 also at"));
  EXPECT_THAT(result.reason, HasSubstr("where the phase margin is -22.96"));
  ASSERT_FALSE(result.nearest.empty());
  for (const auto* list : {&result.nearest, &result.relaxed}) {
    for (const TunedController& design : *list) expect_achieved(plant, design);
  }
}

// Four plants, 0.1 to 100 rad/s, 10 to 170 degrees: what is called feasible holds, and whatever is refused comes with
// an offer (every one of these plants has iso-damped designs somewhere).
TEST(Tune, WhatIsFeasibleIsStableAndRuledByItsOwnCrossover) {
  const FractionalModel plants[] = {
      kNonNewtonianModel, kNewtonianModel, {0.4, 0.01, 0.02, 1, 1.9, 0.5}, {0.2, 0.05, 0.4, 1, 1.5, 0.9}};
  int feasible = 0, refused = 0;
  for (const FractionalModel& plant : plants) {
    for (const double omega_rad_s : log_spaced(0.1, 100, 25)) {
      for (int margin_deg = 10; margin_deg <= 170; margin_deg += 16) {
        const TuningSpec spec{omega_rad_s, static_cast<double>(margin_deg)};
        SCOPED_TRACE(testing::Message() << plant.kp << ", " << omega_rad_s << " rad/s, " << margin_deg << " degrees");
        const TuningResult result = tune(plant, spec);
        EXPECT_EQ(result.is_feasible, result.tuned.has_value());
        EXPECT_TRUE(result.is_feasible || !result.nearest.empty() || !result.relaxed.empty()) << result.reason;
        if (result.tuned) expect_achieved(plant, *result.tuned);
        for (const TunedController& design : result.nearest) expect_achieved(plant, design);
        feasible += result.is_feasible;
        refused += result.refused.has_value();
      }
    }
  }
  EXPECT_GT(feasible, 100);
  EXPECT_GT(refused, 5);
}

TEST(Tune, NamesAFixedMuAboveOneAsWhatItIs) {
  const TuningResult result = tune(kNonNewtonianModel, {5, 100, 1.2});
  ASSERT_TRUE(result.is_feasible);
  EXPECT_THAT(result.tuned->name, HasSubstr("above 1: amplifies noise more than a derivative"));
  expect_achieved(kNonNewtonianModel, *result.tuned);
}

TEST(Tune, AMarginThatThePlantHasByItselfNeedsNoDerivative) {
  const double own_deg = 180 + open_loop_phase_rad({kNonNewtonianModel, {1, 0, 1}}, 5) * kDegPerRad;
  const TuningResult result = tune(kNonNewtonianModel, {5, own_deg, 0.9});
  ASSERT_TRUE(result.is_feasible);
  EXPECT_EQ(result.tuned->controller.kd, 0);
  expect_achieved(kNonNewtonianModel, *result.tuned);
}

TEST(Tune, FeasiblePhaseMarginsAreTheReference) {
  for (const auto& row : golden()["feasible_phi_m_intervals_position"]) {
    const auto range = feasible_phase_margins(kNonNewtonianModel, row[0]);
    ASSERT_TRUE(range) << row;
    EXPECT_NEAR(range->low_deg, row[1], 1e-7) << row;
    EXPECT_NEAR(range->high_deg, row[2], 1e-7) << row;
  }
  const auto crossings = golden()["R_half_crossings"];
  EXPECT_TRUE(feasible_phase_margins(kNonNewtonianModel, crossings[0].get<double>() - 1e-6));
  EXPECT_FALSE(feasible_phase_margins(kNonNewtonianModel, crossings[0].get<double>() + 1e-6));
  EXPECT_FALSE(feasible_phase_margins(kNonNewtonianModel, crossings[1].get<double>() - 1e-6));
  EXPECT_TRUE(feasible_phase_margins(kNonNewtonianModel, crossings[1].get<double>() + 1e-6));
}

TEST(Tune, RefusesBadArgumentsQuotingThem) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::pair<TuningSpec, const char*> bad[] = {{{0, 90}, "is 0"},      {{-3, 90}, "is -3"},   {{nan, 90}, "nan"},
                                                    {{5, 0}, "is 0"},       {{5, 180}, "180"},     {{5, nan}, "nan"},
                                                    {{5, 90, 0.0}, "is 0"}, {{5, 90, 2.0}, "is 2"}};
  for (const auto& [spec, text] : bad) {
    try {
      tune(kNonNewtonianModel, spec);
      ADD_FAILURE() << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(text));
    }
  }
  FractionalModel backwards = kNonNewtonianModel;
  backwards.kp = -0.1;
  EXPECT_THROW(tune(backwards, {5, 91}), std::invalid_argument);
  EXPECT_THROW(feasible_phase_margins(kNonNewtonianModel, 0), std::invalid_argument);
}

class RandomSpecs : public testing::Test {
 protected:
  FractionalModel next_plant() {
    const double beta = between(0.3, 1), alpha = between(beta + 0.2, 2), scale_s = std::exp(between(-6, 6));
    return {std::exp(between(-4, 4)),
            std::exp(between(-4, 2)) * std::pow(scale_s, alpha),
            std::exp(between(-3, 3)) * std::pow(scale_s, beta),
            1,
            alpha,
            beta};
  }
  TuningSpec next_spec(const FractionalModel& plant) {
    const double break_rad_s = std::pow(plant.b2, -1 / plant.beta);
    return {break_rad_s * std::exp(between(-4, 4)), between(1, 179), std::nullopt, between(0, 1) < 0.5};
  }
  double between(double low, double high) { return std::uniform_real_distribution{low, high}(generator_); }

 private:
  std::mt19937 generator_{14};
};

TEST_F(RandomSpecs, TunedLoopsMeetFeasibleSpecificationsExactly) {
  int feasible = 0;
  for (int i = 0; i < 400; ++i) {
    SCOPED_TRACE(i);
    const FractionalModel plant = next_plant();
    TuningSpec spec = next_spec(plant);
    const auto range = feasible_phase_margins(plant, spec.gain_crossover_rad_s, spec.is_velocity_loop);
    if (!range || range->high_deg < 2 || range->low_deg > 178) continue;
    const double low_deg = std::max(range->low_deg, 1.0), high_deg = std::min(range->high_deg, 179.0);
    spec.phase_margin_deg = low_deg + (high_deg - low_deg) * between(0.02, 0.98);
    const TuningResult result = tune(plant, spec);
    if (result.refused) continue;  // has a solution, and another test
    ASSERT_TRUE(result.is_feasible) << result.reason;
    EXPECT_TRUE(result.tuned->controller.mu > 0 && result.tuned->controller.mu < 1 && result.tuned->controller.kd > 0);
    expect_achieved(plant, *result.tuned);
    expect_iso_damped(plant, *result.tuned);
    ++feasible;
  }
  EXPECT_GT(feasible, 100);
}

TEST_F(RandomSpecs, WhatIsOfferedInsteadIsItselfFeasible) {
  int offers = 0;
  for (int i = 0; i < 40; ++i) {
    SCOPED_TRACE(i);
    const FractionalModel plant = next_plant();
    TuningSpec spec = next_spec(plant);
    if (i % 2 == 1) spec.mu = between(0.1, 1.2);
    const TuningResult result = tune(plant, spec);
    EXPECT_EQ(result.reason.empty(), result.is_feasible);
    for (const auto* list : {&result.nearest, &result.relaxed}) {
      for (const TunedController& design : *list) {
        const TuningResult again = tune(plant, design.spec);
        ASSERT_TRUE(again.is_feasible) << design.name << ": " << again.reason;
        expect_relative(again.tuned->controller.kp, design.controller.kp, 1e-9);
        expect_achieved(plant, design);
        ++offers;
      }
    }
  }
  EXPECT_GT(offers, 40);
}

// Sets mu on a fine grid, kd from the phase alone, and looks for a change of sign of the slope: no formula of (4), (5).
bool brute_force_finds_iso_damping(const FractionalModel& plant, const TuningSpec& spec) {
  const double omega_rad_s = spec.gain_crossover_rad_s;
  const auto loop_with = [&](double kd, double mu) { return OpenLoop{plant, {1, kd, mu}, spec.is_velocity_loop}; };
  double previous = 0;
  for (int i = 1; i <= 200; ++i) {
    const double mu = i / 200.0, unit = std::pow(omega_rad_s, -mu);
    const auto margin_deg = [&](double log_kd) {
      return 180 + kDegPerRad * open_loop_phase_rad(loop_with(std::exp(log_kd) * unit, mu), omega_rad_s);
    };
    double low = -30, high = 30;
    if (margin_deg(low) > spec.phase_margin_deg || margin_deg(high) < spec.phase_margin_deg) continue;
    for (int halving = 0; halving < 50; ++halving) {
      const double middle = (low + high) / 2;
      (margin_deg(middle) < spec.phase_margin_deg ? low : high) = middle;
    }
    const double slope = open_loop_phase_slope_s(loop_with(std::exp(low) * unit, mu), omega_rad_s);
    if (slope * previous < 0) return true;
    previous = slope;
  }
  return false;
}

TEST_F(RandomSpecs, TheConditionIsWhatBruteForceFinds) {
  int feasible = 0, compared = 0;
  for (int i = 0; i < 60; ++i) {
    const FractionalModel plant = next_plant();
    const TuningSpec spec = next_spec(plant);
    const TuningResult result = tune(plant, spec);
    if (result.is_feasible && result.tuned->controller.mu > 0.99) continue;  // nearer to the border than the grid
    if (result.is_feasible && result.tuned->controller.mu < result.theta_deg / 90 + 0.01) continue;
    const bool has_solution = result.is_feasible || result.refused;
    EXPECT_EQ(brute_force_finds_iso_damping(plant, spec), has_solution) << i << ": " << result.reason;
    feasible += has_solution;
    ++compared;
  }
  EXPECT_GT(compared, 40);
  EXPECT_GT(feasible, 3);
}

}  // namespace
}  // namespace control
