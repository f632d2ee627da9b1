// The body in the fluid: what the motor's duty makes of position, velocity and acceleration.
#pragma once

#include "control/modal_plant.hpp"

namespace sim_robot {

// Advances by a fixed dt_s per step.
class Plant {
 public:
  Plant(const control::FractionalModel& model, double dt_s) : motion_(model, dt_s) {}

  void step(double duty) { motion_.step(duty); }

  double position_m() const { return motion_.position_m(); }
  double velocity_m_s() const { return motion_.velocity_m_s(); }
  double acceleration_m_s2() const { return motion_.acceleration_m_s2(); }

 private:
  control::ModalPlant motion_;
};

}  // namespace sim_robot
