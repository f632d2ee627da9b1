// Whether the station's limits and those of the robot allow what a profile commands, checked before anything begins.
// Pure.
#pragma once

#include <limits>

#include "server/config/envelope.hpp"
#include "server/experiments/time_line.hpp"
#include "server/runtime/result.hpp"

namespace server::experiments {

// invalid, naming the step and the limit. `fluid_of_robot`: where the profile names none.
Result<void> check_limits(const Profile& profile, const config::Envelope& envelope, const std::string& fluid_of_robot);

inline constexpr double kWayBack_s = 15;      // for a robot to go back to where its run begins
inline constexpr double kBetweenRuns_s = 10;  // with until: for a fit, as a rule

// The longest time in auto without a break, of all runs.
double longest_auto_s(const Profile& profile);

// The extremes that a profile asks of a robot, over all its runs; steps count from 1.
struct Demands {
  double duty_min = 0;
  std::size_t duty_step = 0;
  double setpoint_min_m = 0, setpoint_max_m = 0;
  std::size_t setpoint_min_step = 0, setpoint_max_step = 0;
  double disturbance_max_m = 0;  // magnitude
  std::size_t disturbance_step = 0;
  double longest_auto_s = 0;  // of a run, or of the way back to the next
};
Demands demands_of(const Profile& profile);

// The limits beyond which a robot refuses a command, as far as they are known.
struct RobotLimits {
  bool has_reverse = true;  // false where the controller in force has duty_min 0, as for a motor without reverse
  float setpoint_min_m = -std::numeric_limits<float>::infinity();
  float setpoint_max_m = std::numeric_limits<float>::infinity();
  float disturbance_max_m = std::numeric_limits<float>::infinity();
  float auto_limit_s = std::numeric_limits<float>::infinity();
};

// invalid, naming the step, the value and what to do: the robot would refuse it in the middle of a run.
Result<void> check_demands(const Demands& demands, const RobotLimits& limits);

}  // namespace server::experiments
