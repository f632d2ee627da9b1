// The ring keeps the newest samples, their times and the values of their batches.
#include "robot_fw/core/telemetry_ring.hpp"

#include <gtest/gtest.h>

namespace robot_fw {
namespace {

class Ring : public ::testing::Test {
 protected:
  bool push(float position_m = 0) {
    Sample sample;
    sample.position_m = position_m;
    const bool started = ring.push(sample, values, saturated, now_us, 10'000);
    now_us += 10'000;
    return started;
  }
  protocol::Telemetry read(std::uint64_t first_seq, std::size_t count = 25) {
    protocol::Telemetry batch = rheonaut_Telemetry_init_zero;
    ring.read(first_seq, count, batch);
    return batch;
  }

  TelemetryRing ring;
  BatchValues values;
  bool saturated = false;
  std::uint64_t now_us = 5'000;
};

TEST_F(Ring, NumbersSamplesFromZeroAndKnowsTheirTime) {
  for (int i = 0; i < 30; ++i) push(static_cast<float>(i));
  const auto batch = read(7, 5);
  EXPECT_EQ(batch.first_seq, 7u);
  EXPECT_EQ(batch.first_robot_time_us, 75'000u);
  EXPECT_EQ(batch.period_us, 10'000u);
  ASSERT_EQ(batch.position_m_count, 5);
  EXPECT_EQ(batch.position_m[4], 11);
}

TEST_F(Ring, ABatchNeverSpansAChangeOfItsValues) {
  EXPECT_TRUE(push());
  EXPECT_FALSE(push());
  values.has_setpoint = true;
  EXPECT_TRUE(push());
  EXPECT_FALSE(push());
  EXPECT_EQ(read(0).position_m_count, 2);
  EXPECT_FALSE(read(0).has_setpoint_m);
  EXPECT_EQ(read(2).position_m_count, 2);
  EXPECT_TRUE(read(2).has_setpoint_m);
}

TEST_F(Ring, ABatchNeverSpansAStepOfTimeButToleratesJitter) {
  push();
  now_us += 2'000;
  EXPECT_FALSE(push());
  now_us += 30'000;
  EXPECT_TRUE(push());
  EXPECT_EQ(read(0).position_m_count, 2);
  EXPECT_EQ(read(2).first_robot_time_us, 57'000u);
}

TEST_F(Ring, OverwritesTheOldestAndCountsIt) {
  for (int i = 0; i < 1000; ++i) push(static_cast<float>(i));
  EXPECT_EQ(ring.oldest_seq(), 200u);
  EXPECT_EQ(ring.next_seq(), 1000u);
  EXPECT_EQ(ring.lost(), 200u);
  EXPECT_EQ(read(200).position_m[0], 200);
  EXPECT_EQ(read(200).oldest_seq, 200u);
}

TEST_F(Ring, HoldsEightSecondsInTwentyTwoKilobytes) {
  EXPECT_LE(sizeof ring, 22'000u);
  while (now_us < 8'000'000) push();
  EXPECT_EQ(ring.fill(), 800u);
  EXPECT_EQ(ring.oldest_seq(), 0u);
  EXPECT_EQ(ring.lost(), 0u);
  push();
  EXPECT_EQ(ring.oldest_seq(), 1u);
  EXPECT_EQ(ring.lost(), 1u);
}

TEST_F(Ring, GivesBatchesOfOneToTwentyFive) {
  for (int i = 0; i < 30; ++i) push();
  for (std::size_t capacity = 1; capacity <= 25; ++capacity) EXPECT_EQ(read(2, capacity).position_m_count, capacity);
  EXPECT_EQ(read(2, 800).position_m_count, 25);  // more do not fit into a frame
  EXPECT_EQ(read(28, 25).position_m_count, 2);
}

TEST_F(Ring, ForgetsWhatIsDurableWithoutCountingIt) {
  for (int i = 0; i < 1000; ++i) {
    push();
    ring.acknowledge(ring.next_seq());
  }
  EXPECT_EQ(ring.lost(), 0u);
  EXPECT_EQ(ring.fill(), 0u);
}

TEST_F(Ring, IgnoresAnAcknowledgementOfSamplesItNeverMade) {
  push();
  ring.acknowledge(2);
  EXPECT_EQ(ring.oldest_seq(), 0u);
}

TEST_F(Ring, KeepsAtMost32SegmentsAndCountsWhatGoesWithTheOldest) {
  for (int i = 0; i < 40; ++i) {
    values.setpoint_m = static_cast<float>(i);
    push();
    push();
  }
  EXPECT_EQ(ring.lost(), 16u);
  EXPECT_EQ(ring.oldest_seq(), 16u);
  EXPECT_EQ(read(16).setpoint_m, 8);
  EXPECT_EQ(read(79).setpoint_m, 39);
}

TEST_F(Ring, ABatchIsSaturatedWhenOneOfItsSamplesWas) {
  push();
  saturated = true;
  push();
  saturated = false;
  push();
  EXPECT_EQ(read(0, 3).flags, unsigned{rheonaut_TELEMETRY_FLAG_SATURATED});
  EXPECT_EQ(read(2, 1).flags, 0u);
}

}  // namespace
}  // namespace robot_fw
