// Executes the sections.
#include "robot_fw/core/controller.hpp"

namespace robot_fw {

Controller::Controller(const ControllerSections& sections) : sections_(sections), direct_(sections.kp) {
  for (std::size_t i = 0; i < sections_.count; ++i) direct_ -= sections_.residue[i] / (1 - sections_.pole[i]);  // (2)
}

float Controller::step(float error_m) {
  float duty = direct_ * error_m;
  for (std::size_t i = 0; i < sections_.count; ++i) {  // (1)
    duty += sections_.residue[i] * state_[i];
    state_[i] = sections_.pole[i] * state_[i] + error_m;
  }
  return duty;
}

}  // namespace robot_fw
