// What a run of a profile is expected to do: the commands on a model of the robot, at its tick.
//
//   manual: u = duty;  auto: u = clamp(G(z)(setpoint - (x + disturbance)));  x from the plant under u held      (1)
//
// The controller begins from rest whenever auto begins. The model's position is exact, where the robot has an estimate;
// neither flow nor noise is in it. The run begins at rest at `from_m`. Pure. Errors: throws std::invalid_argument
// quoting the bad value.
#pragma once

#include <string>
#include <vector>

#include "control/models/plant_models.hpp"
#include "control/responses/sections.hpp"
#include "server/experiments/time_line.hpp"

namespace server::experiments {

struct Preview {
  std::vector<double> time_s, position_m, velocity_m_s, duty, setpoint_m;  // setpoint: NaN in manual
  double position_min_m = 0, position_max_m = 0;
  double travel_m = 0;                // length of the way
  double at_power_s = 0;              // longest time at a duty beyond 0.9
  std::vector<std::string> problems;  // why the profile should not be run so, in words; each names the step
};

Preview preview_of(const Profile& profile, const TimeLine& line, const control::FractionalModel& plant,
                   const control::ParallelSections& controller, double duty_min = -1, double duty_max = 1,
                   double from_m = 0);

}  // namespace server::experiments
