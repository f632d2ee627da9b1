// The frames of tests/data/golden_frames.txt built from code: what all builders share.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "protocol/frame.hpp"

namespace protocol {

using FrameBytes = std::vector<std::uint8_t>;
using Built = std::map<std::string, FrameBytes>;  // by the name of the frame

// Each adds its frames.
void build_robot_frames(Built& built);
void build_station_frames(Built& built);

inline constexpr std::uint64_t kMax64 = std::numeric_limits<std::uint64_t>::max();
inline constexpr std::uint32_t kMax32 = std::numeric_limits<std::uint32_t>::max();
inline constexpr std::uint64_t kBoot = 0x1234'5678'9ABC'DEF0;
inline constexpr std::uint64_t kCommand = 0x7F00'0000'0000'0001;
inline constexpr std::uint64_t kEmergency = 0x5A5A'5A5A'5A5A'5A5A;

template <class Frame>
FrameBytes framed(const Frame& frame) {
  FrameBytes bytes(kMaxFramedBytes);
  bytes.resize(write_frame(frame, bytes.data(), bytes.size()));
  return bytes;
}

// Zero in every byte, also in the members of the union that are not chosen.
template <class Frame>
Frame zero_frame(pb_size_t which_body) {
  Frame frame;
  std::memset(&frame, 0, sizeof frame);
  frame.which_body = which_body;
  return frame;
}

inline RobotFrame from_robot(pb_size_t which_body, std::uint64_t robot_time_us = 1'500'000) {
  auto frame = zero_frame<RobotFrame>(which_body);
  frame.robot_time_us = robot_time_us;
  return frame;
}

inline StationFrame from_station(pb_size_t which_body) { return zero_frame<StationFrame>(which_body); }

// The command that most examples use: for kBoot, good until robot time 5.5 s. `number` makes its id.
inline StationFrame command(pb_size_t which_action, std::uint64_t number) {
  auto frame = from_station(rheonaut_StationFrame_command_tag);
  frame.body.command.command_id = kCommand - 1 + number;
  frame.body.command.boot_id = kBoot;
  frame.body.command.valid_until_robot_us = 5'500'000;
  frame.body.command.which_action = which_action;
  return frame;
}

template <std::size_t size>
void set_text(char (&field)[size], const std::string& text) {
  ASSERT_LT(text.size(), size);
  std::memcpy(field, text.c_str(), text.size() + 1);
}

template <std::size_t size>
void set_column(float (&field)[size], pb_size_t& count, std::initializer_list<float> values) {
  ASSERT_LE(values.size(), size);
  std::copy(values.begin(), values.end(), field);
  count = static_cast<pb_size_t>(values.size());
}

inline void set_sample_count(Telemetry& batch, pb_size_t count) {
  batch.position_m_count = batch.velocity_m_s_count = batch.acceleration_m_s2_count = count;
  batch.duty_count = batch.impedance_mv_count = batch.reference_m_count = count;
}

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
