// The models that control/ makes of plants, on the robot: stepped as they were fitted, and good for the position.
#include "control/discretisation/estimator_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "control/responses/time_response.hpp"
#include "robot_fw/core/parameters.hpp"
#include "tests/control/fluid_family.hpp"
#include "tests/robot_fw/estimator_trial.hpp"

namespace robot_fw {
namespace {

constexpr float kModelTickS = 0.01F;

EstimatorParameters parameters_of(const control::EstimatorModel& model) {
  EstimatorParameters parameters;
  parameters.model = {model.sections.gain_m_s, model.sections.time_constant_s};
  parameters.is_confirmed = true;
  return parameters;
}

// The largest error of the velocity after a step of duty, by the model alone: no reading comes.
double largest_error_m_s(const EstimatorParameters& parameters, const control::FractionalModel& plant) {
  std::vector<double> time_s;
  for (int tick = 1; tick <= 6000; ++tick) time_s.push_back(0.01 * tick);
  const auto response = control::step_response(plant, 1, time_s).velocity_m_s;
  Estimator estimator{parameters};
  double largest_m_s = 0;
  for (const double velocity_m_s : response) {
    estimator.step({0, false, 1, kModelTickS});
    largest_m_s = std::max(largest_m_s, std::abs(static_cast<double>(estimator.velocity_m_s()) - velocity_m_s));
  }
  return largest_m_s;
}

TEST(EstimatorModelOnTheRobot, IsSteppedAsItsFitErrorSays) {
  for (const auto& plant : {control::kNonNewtonianModel, control::kNewtonianModel, control::fluid_family(2, 7)[1]}) {
    const control::EstimatorModel model = control::estimator_model(plant);
    EXPECT_NEAR(largest_error_m_s(parameters_of(model), plant) * plant.b3 / plant.kp, model.fit_error, 1e-4);
  }
}

TEST(EstimatorModelOnTheRobot, ItsParametersAreInTheirRanges) {
  constexpr auto kGain = static_cast<std::size_t>(ParameterId::model_gain_1_m_s);
  constexpr auto kTime = static_cast<std::size_t>(ParameterId::model_time_constant_1_s);
  for (const double kp : {0.001, -0.1, 3.0, 30.0}) {
    control::FractionalModel plant = control::kNonNewtonianModel;
    plant.kp = kp;
    const auto sections = control::estimator_model(plant).sections;
    for (std::size_t i = 0; i < control::kEstimatorSections; ++i) {
      EXPECT_GE(sections.gain_m_s[i], Parameters::spec(kGain + i).minimum);
      EXPECT_LE(sections.gain_m_s[i], Parameters::spec(kGain + i).maximum);
      EXPECT_GE(sections.time_constant_s[i], Parameters::spec(kTime + i).minimum);
      EXPECT_LE(sections.time_constant_s[i], Parameters::spec(kTime + i).maximum);
    }
  }
}

// Figure 7's loop, closed on the estimate. docs/robot.md has more fluids and seeds.
TEST(EstimatorModelOnTheRobot, KnowsThePositionInTheFluidsWhoseModelItHas) {
  const auto& middle = control::kNonNewtonianModel;
  for (const auto& plant : {control::FractionalModel{0.1, 0.65 * middle.b1, 0.57 * middle.b2, 1, 1.67, 0.83},
                            control::FractionalModel{0.1, 1.21 * middle.b1, 2.00 * middle.b2, 1, 1.68, 0.72},
                            control::FractionalModel{0.1, 1.19 * middle.b1, 1.20 * middle.b2, 1, 1.90, 0.97},
                            control::FractionalModel{0.1, 0.50 * middle.b1, 0.61 * middle.b2, 1, 1.42, 0.70}}) {
    EstimatorTrial trial;
    trial.truth = plant;
    trial.estimator = parameters_of(control::estimator_model(plant));
    trial.closed_loop = true;
    trial.disturbance_m = -0.05;
    for (const std::uint64_t seed : {1U, 2U}) {
      const TrialResult result = run_trial(trial, seed);
      EXPECT_GE(result.share_within, 0.95) << plant.alpha;
      EXPECT_LE(std::abs(result.estimate_error_m), std::min(0.010, 2 * result.position_sd_m)) << plant.alpha;
      EXPECT_LE(result.position_sd_m, 0.007) << plant.alpha;
      EXPECT_LT(result.mismatch_s, 0) << plant.alpha;
    }
  }
}

}  // namespace
}  // namespace robot_fw
