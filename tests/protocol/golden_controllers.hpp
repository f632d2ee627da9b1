// The two controllers of the golden frames, with their checksums.
#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <stdexcept>

#include "protocol/frame.hpp"

namespace protocol {

template <std::size_t size>
void set_column(float (&field)[size], pb_size_t& count, std::initializer_list<float> values) {
  if (values.size() > size) throw std::length_error("more values than the message has room for");
  std::ranges::copy(values, field);
  count = static_cast<pb_size_t>(values.size());
}

// Of the golden frame `set_controller`: the paper's, as discretised for 100 Hz.
inline Controller paper_controller() {
  Controller controller = rheonaut_Controller_init_zero;
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

// Of the golden frame `set_controller_biquads`.
inline Controller biquad_controller() {
  Controller controller = rheonaut_Controller_init_zero;
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

}  // namespace protocol
