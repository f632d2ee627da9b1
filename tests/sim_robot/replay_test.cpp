// Frames of a recording, sent as those of another robot: they decode, follow each other, and hold what was recorded.
#include "sim_robot/fleet/replay.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <stdexcept>
#include <vector>

namespace sim_robot {
namespace {

protocol::RobotFrame written(const Recording& recording, std::uint64_t number, const Recording::Head& head) {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
  protocol::Bytes stream{bytes.data(), recording.write(number, head, bytes.data(), bytes.size())};
  protocol::FrameReader reader;
  EXPECT_EQ(reader.push(stream), protocol::FrameReader::State::complete);
  EXPECT_TRUE(stream.empty());
  const auto frame = protocol::decode_robot_frame(reader.payload());
  EXPECT_TRUE(frame.has_value());
  return frame.value_or(protocol::RobotFrame{});
}

protocol::RobotFrame telemetry(std::uint64_t first_seq, pb_size_t count, std::uint32_t flags = 0) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_telemetry_tag;
  protocol::Telemetry& batch = frame.body.telemetry;
  batch.first_seq = first_seq;
  batch.period_us = 10'000;
  batch.flags = flags;
  batch.position_m_count = batch.velocity_m_s_count = batch.acceleration_m_s2_count = count;
  batch.duty_count = batch.impedance_mv_count = batch.reference_m_count = count;
  for (pb_size_t i = 0; i < count; ++i) batch.position_m[i] = static_cast<float>(first_seq + i);
  return frame;
}

Recording recording_of(const std::vector<protocol::RobotFrame>& frames) {
  std::vector<std::uint8_t> stream;
  for (const auto& frame : frames) {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
    const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
    stream.insert(stream.end(), bytes.data(), bytes.data() + size);
  }
  return Recording{{stream.data(), stream.size()}};
}

TEST(Recording, FramesFollowEachOtherWithoutAHoleThroughEveryRepetition) {
  const Recording recording = make_recording(2, 10, 1);
  EXPECT_EQ(recording.samples(), 10 * recording.frames());
  std::uint64_t next_seq = 0;
  for (std::uint64_t number = 0; number < 3 * recording.frames(); ++number) {
    const auto frame = written(recording, number, {number * 100'000, 10'000, next_seq / 2, false});
    const protocol::Telemetry& batch = frame.body.telemetry;
    ASSERT_EQ(frame.which_body, pb_size_t{rheonaut_RobotFrame_telemetry_tag});
    EXPECT_EQ(frame.robot_time_us, number * 100'000);
    EXPECT_EQ(batch.first_seq, next_seq);
    EXPECT_EQ(batch.first_robot_time_us, next_seq * 10'000);
    EXPECT_EQ(batch.period_us, 10'000u);
    EXPECT_EQ(batch.oldest_seq, next_seq / 2);
    EXPECT_EQ(batch.flags & rheonaut_TELEMETRY_FLAG_BACKFILL, 0u);
    EXPECT_EQ(recording.frame_of(next_seq), number);
    EXPECT_EQ(recording.frame_of(next_seq + batch.position_m_count - 1), number);
    next_seq += batch.position_m_count;
    EXPECT_EQ(recording.end_seq(number), next_seq);
  }
}

TEST(Recording, KeepsWhatWasRecordedAndMarksWhatIsSentAgain) {
  const Recording recording = recording_of({telemetry(100, 3, rheonaut_TELEMETRY_FLAG_SATURATED), telemetry(103, 2)});
  EXPECT_EQ(recording.samples(), 5u);
  const auto again = written(recording, 0, {7, 5'000, 0, true}).body.telemetry;
  EXPECT_EQ(again.flags, unsigned{rheonaut_TELEMETRY_FLAG_SATURATED | rheonaut_TELEMETRY_FLAG_BACKFILL});
  EXPECT_EQ(again.position_m[2], 102);
  EXPECT_EQ(again.first_seq, 0u);
  const auto second = written(recording, 3, {7, 5'000, 0, true}).body.telemetry;
  EXPECT_EQ(second.flags, unsigned{rheonaut_TELEMETRY_FLAG_BACKFILL});
  EXPECT_EQ(second.first_seq, 8u);
  EXPECT_EQ(second.first_robot_time_us, 40'000u);
  EXPECT_EQ(second.position_m_count, 2);
}

TEST(Recording, PassesOverWhatIsNotNewTelemetry) {
  protocol::RobotFrame status = rheonaut_RobotFrame_init_zero;
  status.which_body = rheonaut_RobotFrame_status_tag;
  const Recording recording =
      recording_of({status, telemetry(0, 5), telemetry(0, 5, rheonaut_TELEMETRY_FLAG_BACKFILL), telemetry(5, 25)});
  EXPECT_EQ(recording.frames(), 2u);
  EXPECT_EQ(recording.samples(), 30u);
}

TEST(Recording, RefusesWhatIsNoTelemetry) {
  EXPECT_THROW(recording_of({}), std::invalid_argument);
  const std::array<std::uint8_t, 5> text{'h', 'e', 'l', 'l', 'o'};
  EXPECT_THROW((Recording{{text.data(), text.size()}}), std::invalid_argument);
  EXPECT_THROW(load_recording("no/such/file"), std::invalid_argument);
}

TEST(Recording, NeverWritesHalfAFrame) {
  const Recording recording = recording_of({telemetry(0, 25)});
  std::array<std::uint8_t, 100> bytes;
  EXPECT_EQ(recording.write(0, {}, bytes.data(), bytes.size()), 0u);
  EXPECT_GT(written(recording, UINT64_MAX / 100, {UINT64_MAX, UINT32_MAX, UINT64_MAX, true}).robot_time_us, 0u);
}

TEST(ReplayPeriod, FollowsTheRateWithinReason) {
  const Recording recording = recording_of({telemetry(0, 5)});
  EXPECT_EQ(replay_period_us(recording, 1), 10'000u);
  EXPECT_EQ(replay_period_us(recording, 2), 5'000u);
  EXPECT_EQ(replay_period_us(recording, 0.5), 20'000u);
  for (const double rate : {0.0, -1.0, 1000.0, 1e-4, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(replay_period_us(recording, rate), std::invalid_argument) << rate;
  }
}

}  // namespace
}  // namespace sim_robot
