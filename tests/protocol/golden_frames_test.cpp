// Every message of the protocol, built from code, has exactly the bytes of tests/data/golden_frames.txt.
#include <gtest/gtest.h>

#include <bit>
#include <span>

#include "golden_builders.hpp"
#include "golden_file.hpp"

namespace protocol {
namespace {

// CRC-32 (IEEE), bit by bit.
std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = kMax32;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB8'8320U : 0);
  }
  return ~crc;
}

// The bytes that Controller.checksum covers: fields 3 to 14, 4 bytes each, little-endian.
FrameBytes checksummed_bytes(const Controller& controller) {
  FrameBytes bytes;
  const auto append = [&](std::uint32_t word) {
    for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(word >> shift));
  };
  const auto append_all = [&](const float* values, pb_size_t count) {
    for (pb_size_t i = 0; i < count; ++i) append(std::bit_cast<std::uint32_t>(values[i]));
  };
  append(controller.period_us);
  append_all(&controller.kp, 1);
  append_all(&controller.direct, 1);
  append_all(controller.pole, controller.pole_count);
  append_all(controller.residue, controller.residue_count);
  append_all(controller.biquad_b0, controller.biquad_b0_count);
  append_all(controller.biquad_b1, controller.biquad_b1_count);
  append_all(controller.biquad_a1, controller.biquad_a1_count);
  append_all(controller.biquad_a2, controller.biquad_a2_count);
  append_all(&controller.duty_min, 1);
  append_all(&controller.duty_max, 1);
  append(static_cast<std::uint32_t>(controller.derivative_on));
  return bytes;
}

std::string hex(const FrameBytes& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 0xF];
    text += ' ';
  }
  return text;
}

TEST(GoldenFrames, EveryMessageBuiltFromCodeHasTheBytesOfTheFile) {
  Built built;
  build_robot_frames(built);
  build_station_frames(built);
  const auto golden = read_golden_frames();
  EXPECT_EQ(built.size(), golden.size());
  for (const GoldenFrame& frame : golden) {
    const auto found = built.find(frame.name);
    ASSERT_NE(found, built.end()) << frame.name << " is in the file but not built here";
    EXPECT_EQ(hex(found->second), hex(frame.bytes)) << frame.name;
  }
}

TEST(GoldenFrames, DecodingAndEncodingAgainGivesTheSameBytes) {
  for (const GoldenFrame& golden : read_golden_frames()) {
    const FrameBytes payload = golden.payload();
    if (golden.from_robot) {
      const auto frame = decode_robot_frame({payload.data(), payload.size()});
      ASSERT_TRUE(frame.has_value()) << golden.name;
      EXPECT_EQ(hex(framed(*frame)), hex(golden.bytes)) << golden.name;
    } else {
      const auto frame = decode_station_frame({payload.data(), payload.size()});
      ASSERT_TRUE(frame.has_value()) << golden.name;
      EXPECT_EQ(hex(framed(*frame)), hex(golden.bytes)) << golden.name;
    }
  }
}

TEST(GoldenFrames, ControllersCarryTheChecksumOfTheirCoefficients) {
  for (const Controller& controller : {paper_controller(), biquad_controller()}) {
    EXPECT_EQ(crc32(checksummed_bytes(controller)), controller.checksum) << "controller " << controller.controller_id;
  }
}

}  // namespace
}  // namespace protocol
