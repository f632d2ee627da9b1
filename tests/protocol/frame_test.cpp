// Frames survive any split of the stream, and what is not a frame is refused.
#include "protocol/frame.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace protocol {
namespace {

using ByteVector = std::vector<std::uint8_t>;

RobotFrame heartbeat(std::uint64_t robot_time_us) {
  RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.robot_time_us = robot_time_us;
  frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
  return frame;
}

RobotFrame telemetry(pb_size_t samples) {
  RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_telemetry_tag;
  Telemetry& batch = frame.body.telemetry;
  batch.position_m_count = batch.velocity_m_s_count = batch.acceleration_m_s2_count = samples;
  batch.duty_count = batch.impedance_mv_count = batch.reference_m_count = samples;
  return frame;
}

void append(ByteVector& stream, const RobotFrame& frame) {
  ByteVector bytes(kMaxFramedBytes);
  bytes.resize(write_frame(frame, bytes.data(), bytes.size()));
  ASSERT_FALSE(bytes.empty());
  stream.insert(stream.end(), bytes.begin(), bytes.end());
}

// Feeds the stream in pieces of the given sizes (the last one repeats) and returns the payloads.
std::vector<ByteVector> read_in_pieces(FrameReader& reader, const ByteVector& stream, std::mt19937& random, int limit) {
  std::vector<ByteVector> payloads;
  for (std::size_t at = 0; at < stream.size();) {
    const auto piece = std::min<std::size_t>(stream.size() - at, 1 + random() % static_cast<unsigned>(limit));
    Bytes input{stream.data() + at, piece};
    at += piece;
    while (!input.empty()) {
      if (reader.push(input) != FrameReader::State::complete) break;
      payloads.emplace_back(reader.payload().begin(), reader.payload().end());
    }
  }
  return payloads;
}

TEST(FrameReader, GivesTheSameFramesForEverySplitOfTheStream) {
  ByteVector stream;
  for (std::uint64_t i = 0; i < 40; ++i) {
    append(stream, heartbeat(i));
    append(stream, telemetry(static_cast<pb_size_t>(1 + i % kMaxSamplesPerFrame)));
  }
  std::mt19937 random{1};
  FrameReader whole;
  const auto expected = read_in_pieces(whole, stream, random, 1'000'000);
  ASSERT_EQ(expected.size(), 80u);
  for (int limit : {1, 2, 3, 7, 64, 500, 5000}) {
    FrameReader reader;
    EXPECT_EQ(read_in_pieces(reader, stream, random, limit), expected) << "pieces of up to " << limit;
  }
}

TEST(FrameReader, RefusesLengthOver1024AndStaysRefused) {
  for (const ByteVector& start : {ByteVector{0x81, 0x08}, ByteVector{0xFF, 0x7F}, ByteVector{0x80, 0x80, 0x01}}) {
    FrameReader reader;
    Bytes input{start.data(), start.size()};
    EXPECT_EQ(reader.push(input), FrameReader::State::oversize);
    const ByteVector more{1, 0};
    Bytes rest{more.data(), more.size()};
    EXPECT_EQ(reader.push(rest), FrameReader::State::oversize);
  }
}

TEST(FrameReader, AcceptsExactly1024Bytes) {
  ByteVector stream{0x80, 0x08};
  stream.resize(2 + kMaxFrameBytes, 0x55);
  FrameReader reader;
  Bytes input{stream.data(), stream.size()};
  EXPECT_EQ(reader.push(input), FrameReader::State::complete);
  EXPECT_EQ(reader.payload().size, kMaxFrameBytes);
}

TEST(FrameReader, SurvivesGarbage) {
  std::mt19937 random{2};
  for (int round = 0; round < 2000; ++round) {
    ByteVector noise(1 + random() % 3000);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    FrameReader reader;
    for (const ByteVector& payload : read_in_pieces(reader, noise, random, 100)) {
      const auto frame = decode_robot_frame({payload.data(), payload.size()});
      decode_station_frame({payload.data(), payload.size()});
      if (frame) EXPECT_NE(frame->which_body, 0);
    }
  }
}

TEST(DecodeRobotFrame, RefusesTelemetryWithUnequalColumns) {
  RobotFrame frame = telemetry(5);
  frame.body.telemetry.duty_count = 4;
  std::uint8_t bytes[kMaxFrameBytes];
  const std::size_t size = encode(frame, bytes, sizeof bytes);
  ASSERT_GT(size, 0u);
  EXPECT_FALSE(decode_robot_frame({bytes, size}).has_value());
}

TEST(Encode, RefusesAFrameWithoutBodyAndABufferThatIsTooSmall) {
  std::uint8_t bytes[kMaxFrameBytes];
  const RobotFrame empty = rheonaut_RobotFrame_init_zero;
  EXPECT_EQ(encode(empty, bytes, sizeof bytes), 0u);
  EXPECT_EQ(write_frame(telemetry(25), bytes, 100), 0u);
}

}  // namespace
}  // namespace protocol
