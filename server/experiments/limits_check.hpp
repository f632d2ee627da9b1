// Whether the station's limits allow what a profile commands, checked before it is queued. Pure.
#pragma once

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

}  // namespace server::experiments
