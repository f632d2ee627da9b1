// The covariance that is computed without readings, beside that of the robot's estimator with them.
#include "control/responses/estimator_covariance.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "robot_fw/core/controller.hpp"
#include "robot_fw/core/estimator.hpp"
#include "sim_robot/world/world.hpp"

namespace robot_fw {
namespace {

control::EstimateParameters parameters_of(const EstimatorParameters& robot) {
  control::EstimateParameters same;
  std::ranges::copy(robot.model.gain_m_s, same.gain_m_s.begin());
  std::ranges::copy(robot.model.time_constant_s, same.time_constant_s.begin());
  same.is_confirmed = robot.is_confirmed;
  return same;
}

TEST(EstimatorCovariance, HasTheDefaultsOfTheRobot) {
  const EstimatorParameters robot;
  const control::EstimateParameters same;
  EXPECT_FLOAT_EQ(static_cast<float>(same.gain_error), robot.gain_error);
  EXPECT_FLOAT_EQ(static_cast<float>(same.section_error), robot.section_error);
  EXPECT_FLOAT_EQ(static_cast<float>(same.shape_error), robot.shape_error);
  EXPECT_FLOAT_EQ(static_cast<float>(same.driven_velocity_m_s), robot.driven_velocity_m_s);
  EXPECT_FLOAT_EQ(static_cast<float>(same.resting_velocity_m_s), robot.resting_velocity_m_s);
  EXPECT_FLOAT_EQ(static_cast<float>(same.correlation_s), robot.correlation_s);
  EXPECT_FLOAT_EQ(static_cast<float>(same.noise_m_s2), robot.noise_m_s2);
  EXPECT_FLOAT_EQ(static_cast<float>(same.bias_m_s2), robot.bias_m_s2);
  EXPECT_FLOAT_EQ(static_cast<float>(same.bias_walk_m_s2), robot.bias_walk_m_s2);
}

// Figure 7's loop on the estimate in the fluid of the model, with the default sensor: the sd at each full second.
TEST(EstimatorCovariance, IsWithinThreePercentOfTheRobotsAlongALoop) {
  for (const bool is_confirmed : {true, false}) {
    sim_robot::WorldConfig config;
    config.imu.emplace();
    sim_robot::World world{config};
    EstimatorParameters parameters;
    parameters.is_confirmed = is_confirmed;
    parameters.doubtful_duty = 0;  // its way is added to the sd of the covariance
    Estimator robot{parameters};
    Controller controller{kPaperController};
    control::EstimatorCovariance computed{parameters_of(parameters)};
    float duty = 0;
    double velocity_m_s = 0;
    for (int tick = 1; tick <= 4000; ++tick) {
      world.step(static_cast<double>(duty));
      const Inputs inputs = world.read(0);
      robot.step({inputs.acceleration_counts, inputs.acceleration_is_valid, duty, 0.01F});
      computed.step(static_cast<double>(duty), world.velocity_m_s() - velocity_m_s);
      velocity_m_s = world.velocity_m_s();
      const auto robot_sd_m = static_cast<double>(robot.position_sd_m());
      if (tick % 100 == 0) {
        EXPECT_NEAR(computed.position_sd_m(), robot_sd_m, 0.03 * robot_sd_m) << tick << ", confirmed " << is_confirmed;
      }
      const float position_m = robot.position_m() + (tick > 2000 ? -0.05F : 0);
      duty = std::clamp(controller.step(0.1F - position_m, position_m).asked, -1.0F, 1.0F);
    }
  }
}

}  // namespace
}  // namespace robot_fw
