// The frames of tests/data/golden_frames.txt built from code: what all builders share.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "protocol/frame.hpp"
#include "tests/protocol/golden_controllers.hpp"

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

inline void set_sample_count(Telemetry& batch, pb_size_t count) {
  batch.position_m_count = batch.velocity_m_s_count = batch.acceleration_m_s2_count = count;
  batch.duty_count = batch.impedance_mv_count = batch.reference_m_count = count;
}

}  // namespace protocol
