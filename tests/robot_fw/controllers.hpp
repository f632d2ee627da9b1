// Controllers as a station sends them, for tests: those of the golden frames, and changed ones with their checksum.
#pragma once

#include <initializer_list>

#include "robot_fw/core/controller_message.hpp"

namespace robot_fw {

inline protocol::Controller with_checksum(protocol::Controller controller) {
  controller.checksum = checksum_of(controller);
  return controller;
}

template <std::size_t size>
void set_column(float (&field)[size], pb_size_t& count, std::initializer_list<float> values) {
  count = 0;
  for (const float value : values) field[count++] = value;
}

// As in the golden frame `set_controller`.
inline protocol::Controller golden_controller() {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.controller_id = 1;
  controller.checksum = 3'099'722'980;
  controller.period_us = 10'000;
  controller.kp = 65.0028F;
  controller.direct = 117.11186F;
  set_column(controller.pole, controller.pole_count, {-0.4649264F, -0.1022562F, 0.4380344F, 0.8222267F, 0.970841F});
  set_column(controller.residue, controller.residue_count,
             {-29.9971855F, -14.5876807F, -5.3258752F, -1.0051928F, -0.0781306F});
  controller.duty_min = -1;
  controller.duty_max = 1;
  return controller;
}

// As in the golden frame `set_controller_biquads`.
inline protocol::Controller golden_biquads() {
  protocol::Controller controller = rheonaut_Controller_init_zero;
  controller.controller_id = 2;
  controller.checksum = 2'356'539'864;
  controller.period_us = 10'000;
  controller.kp = 30;
  controller.direct = 40;
  set_column(controller.pole, controller.pole_count, {0.5F});
  set_column(controller.residue, controller.residue_count, {-3});
  set_column(controller.biquad_b0, controller.biquad_b0_count, {0.25F});
  set_column(controller.biquad_b1, controller.biquad_b1_count, {0.125F});
  set_column(controller.biquad_a1, controller.biquad_a1_count, {-1.5F});
  set_column(controller.biquad_a2, controller.biquad_a2_count, {0.625F});
  controller.duty_max = 1;
  controller.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT;
  return controller;
}

// The paper's with another gain, so that every duty shows which of the two drives.
inline protocol::Controller scaled_controller(std::uint32_t id, float factor) {
  protocol::Controller controller = golden_controller();
  controller.controller_id = id;
  controller.kp *= factor;
  controller.direct *= factor;
  for (float& residue : controller.residue) residue *= factor;
  return with_checksum(controller);
}

}  // namespace robot_fw
