// Checks and converts controllers.
#include "robot_fw/core/controller_message.hpp"

#include <algorithm>
#include <cmath>

#include "robot_fw/core/crc32.hpp"

namespace robot_fw {
namespace {

bool well_formed(const protocol::Controller& controller) {
  const pb_size_t biquads = controller.biquad_b0_count;
  return controller.controller_id != 0 && controller.pole_count == controller.residue_count &&
         controller.biquad_b1_count == biquads && controller.biquad_a1_count == biquads &&
         controller.biquad_a2_count == biquads &&
         (controller.derivative_on == rheonaut_DERIVATIVE_ON_ERROR ||
          controller.derivative_on == rheonaut_DERIVATIVE_ON_MEASUREMENT);
}

bool all_finite(const float* values, pb_size_t count) {
  return std::all_of(values, values + count, [](float value) { return std::isfinite(value); });
}

bool finite(const protocol::Controller& controller) {
  const float numbers[] = {controller.kp, controller.direct, controller.duty_min, controller.duty_max};
  return all_finite(numbers, 4) && all_finite(controller.pole, controller.pole_count) &&
         all_finite(controller.residue, controller.residue_count) &&
         all_finite(controller.biquad_b0, controller.biquad_b0_count) &&
         all_finite(controller.biquad_b1, controller.biquad_b1_count) &&
         all_finite(controller.biquad_a1, controller.biquad_a1_count) &&
         all_finite(controller.biquad_a2, controller.biquad_a2_count);
}

// Real poles within the unit circle; of each biquad the triangle |a2| < 1, |a1| < 1 + a2, which says the same.
bool stable(const protocol::Controller& controller) {
  for (pb_size_t i = 0; i < controller.pole_count; ++i) {
    if (std::fabs(controller.pole[i]) >= 1) return false;
  }
  for (pb_size_t j = 0; j < controller.biquad_a1_count; ++j) {
    const float a1 = controller.biquad_a1[j], a2 = controller.biquad_a2[j];
    if (std::fabs(a2) >= 1 || std::fabs(a1) >= 1 + a2) return false;
  }
  return true;
}

}  // namespace

std::uint32_t checksum_of(const protocol::Controller& controller) {
  Crc32 crc;
  const auto add_all = [&crc](const float* values, pb_size_t count) {
    for (pb_size_t i = 0; i < count; ++i) crc.add_float(values[i]);
  };
  crc.add_word(controller.period_us);
  crc.add_float(controller.kp);
  crc.add_float(controller.direct);
  add_all(controller.pole, controller.pole_count);
  add_all(controller.residue, controller.residue_count);
  add_all(controller.biquad_b0, controller.biquad_b0_count);
  add_all(controller.biquad_b1, controller.biquad_b1_count);
  add_all(controller.biquad_a1, controller.biquad_a1_count);
  add_all(controller.biquad_a2, controller.biquad_a2_count);
  crc.add_float(controller.duty_min);
  crc.add_float(controller.duty_max);
  crc.add_word(static_cast<std::uint32_t>(controller.derivative_on));
  return crc.value();
}

protocol::RejectReason fault_of(const protocol::Controller& controller, const DutyRange& motor,
                                std::uint32_t sample_period_us) {
  if (!well_formed(controller)) return rheonaut_REJECT_REASON_MALFORMED;
  if (checksum_of(controller) != controller.checksum) return rheonaut_REJECT_REASON_CHECKSUM;
  if (!finite(controller)) return rheonaut_REJECT_REASON_NOT_FINITE;
  const bool fits = controller.pole_count + 2 * controller.biquad_b0_count <= static_cast<int>(kMaxSections);
  // SAFETY: a controller never has more of the motor than the motor allows.
  const bool motor_fits = motor.contains(controller.duty_min) && motor.contains(controller.duty_max) &&
                          controller.duty_min <= 0 && controller.duty_max > 0;
  if (!fits || !motor_fits || controller.period_us != sample_period_us || controller.kp <= 0) {
    return rheonaut_REJECT_REASON_OUT_OF_RANGE;
  }
  if (!stable(controller)) return rheonaut_REJECT_REASON_UNSTABLE;  // SAFETY: what grows by itself never runs
  if (!std::isfinite(corrected_direct(sections_of(controller)))) return rheonaut_REJECT_REASON_NOT_FINITE;
  return rheonaut_REJECT_REASON_NONE;
}

ControllerSections sections_of(const protocol::Controller& controller) {
  ControllerSections sections;
  sections.controller_id = controller.controller_id;
  sections.checksum = controller.checksum;
  sections.kp = controller.kp;
  sections.direct = controller.direct;
  sections.count = static_cast<std::uint8_t>(controller.pole_count);
  sections.biquad_count = static_cast<std::uint8_t>(controller.biquad_b0_count);
  auto next = sections.coefficients.begin();
  for (pb_size_t i = 0; i < controller.pole_count; ++i) {
    *next++ = controller.pole[i];
    *next++ = controller.residue[i];
  }
  for (pb_size_t j = 0; j < controller.biquad_b0_count; ++j) {
    *next++ = controller.biquad_b0[j];
    *next++ = controller.biquad_b1[j];
    *next++ = controller.biquad_a1[j];
    *next++ = controller.biquad_a2[j];
  }
  sections.duty_min = controller.duty_min;
  sections.duty_max = controller.duty_max;
  sections.derivative_on_measurement = controller.derivative_on == rheonaut_DERIVATIVE_ON_MEASUREMENT;
  return sections;
}

void write_controller(const ControllerSections& sections, std::uint32_t sample_period_us, protocol::Controller& out) {
  out = rheonaut_Controller_init_zero;
  out.controller_id = sections.controller_id;
  out.checksum = sections.checksum;
  out.period_us = sample_period_us;
  out.kp = sections.kp;
  out.direct = sections.direct;
  out.pole_count = out.residue_count = sections.count;
  for (std::size_t i = 0; i < sections.count; ++i) {
    out.pole[i] = sections.pole(i);
    out.residue[i] = sections.residue(i);
  }
  out.biquad_b0_count = out.biquad_b1_count = out.biquad_a1_count = out.biquad_a2_count = sections.biquad_count;
  for (std::size_t j = 0; j < sections.biquad_count; ++j) {
    const Biquad biquad = sections.biquad(j);
    out.biquad_b0[j] = biquad.b0;
    out.biquad_b1[j] = biquad.b1;
    out.biquad_a1[j] = biquad.a1;
    out.biquad_a2[j] = biquad.a2;
  }
  out.duty_min = sections.duty_min;
  out.duty_max = sections.duty_max;
  out.derivative_on =
      sections.derivative_on_measurement ? rheonaut_DERIVATIVE_ON_MEASUREMENT : rheonaut_DERIVATIVE_ON_ERROR;
}

ControllerSections adapted(ControllerSections sections, const DutyRange& motor, std::uint32_t sample_period_us) {
  sections.duty_min = std::max(sections.duty_min, motor.min);
  sections.duty_max = std::min(sections.duty_max, motor.max);
  protocol::Controller controller;
  write_controller(sections, sample_period_us, controller);
  sections.checksum = checksum_of(controller);
  return sections;
}

}  // namespace robot_fw
