// Executes the sections.
#include "robot_fw/core/controller.hpp"

#include <algorithm>

namespace robot_fw {

float corrected_direct(const ControllerSections& sections) {
  float direct = sections.kp;  // (2)
  for (std::size_t i = 0; i < sections.count; ++i) direct -= sections.residue(i) / (1 - sections.pole(i));
  for (std::size_t j = 0; j < sections.biquad_count; ++j) {
    const Biquad biquad = sections.biquad(j);
    direct -= (biquad.b0 + biquad.b1) / (1 + biquad.a1 + biquad.a2);
  }
  return direct;
}

Controller::Controller(const ControllerSections& sections) : sections_(sections), direct_(corrected_direct(sections)) {}

void Controller::reset() {
  state_.fill(0);
  has_origin_ = false;
}

ControllerDuty Controller::step(float error_m, float position_m) {
  float duty = 0;
  if (sections_.derivative_on_measurement) {  // (3)
    if (!has_origin_) origin_m_ = position_m;
    has_origin_ = true;
    const float moved_m = origin_m_ - position_m;
    duty = sections_.kp * error_m + (direct_ - sections_.kp) * moved_m + drive_sections(moved_m);
  } else {  // (1)
    duty = direct_ * error_m + drive_sections(error_m);
  }
  return {duty, std::clamp(duty, sections_.duty_min, sections_.duty_max)};
}

float Controller::drive_sections(float input_m) {
  float duty = 0;
  for (std::size_t i = 0; i < sections_.count; ++i) {
    duty += sections_.residue(i) * state_[i];
    state_[i] = sections_.pole(i) * state_[i] + input_m;
  }
  for (std::size_t j = 0; j < sections_.biquad_count; ++j) {
    const Biquad biquad = sections_.biquad(j);
    float* w = &state_[sections_.count + 2 * j];
    duty += biquad.b0 * w[0] + biquad.b1 * w[1];
    const float next = input_m - biquad.a1 * w[0] - biquad.a2 * w[1];
    w[1] = w[0];
    w[0] = next;
  }
  return duty;
}

void Controller::add_to(Crc32& crc) const {
  for (const float value : state_) crc.add_float(value);
}

}  // namespace robot_fw
