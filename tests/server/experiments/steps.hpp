// Steps of a profile, for tests.
#pragma once

#include "server/experiments/profile.hpp"

namespace server::experiments {

inline Step step_of(StepKind kind, double for_s) {
  Step step;
  step.kind = kind;
  step.for_s = for_s;
  return step;
}

inline Step duty_step(double duty, double for_s) {
  Step step = step_of(StepKind::duty, for_s);
  step.duty = duty;
  return step;
}

inline Step setpoint_step(double setpoint_m, double for_s) {
  Step step = step_of(StepKind::setpoint, for_s);
  step.setpoint_m = setpoint_m;
  return step;
}

}  // namespace server::experiments
