// Events come out of the ring as they went in, with their numbers; the oldest make room.
#include "robot_fw/core/event_ring.hpp"

#include <gtest/gtest.h>

namespace robot_fw {
namespace {

// Every field at a value that needs all of its place.
protocol::Event full_event() {
  protocol::Event event = rheonaut_Event_init_zero;
  event.event_robot_time_us = 250'000'000'000'000;  // eight years
  event.kind = _rheonaut_EventKind_MAX;
  event.cause = _rheonaut_EventCause_MAX;
  event.sample_seq = 25'000'000'001;  // eight years of samples
  event.mode = _rheonaut_Mode_MAX;
  event.sub_state = _rheonaut_SubState_MAX;
  event.position_m = -0.123456789F;
  event.value = 1e-30F;
  event.emergency_id = 0xFEDC'BA98'7654'3210;
  event.command_id = 0x8000'0000'0000'0001;
  event.emergency_cause = _rheonaut_EmergencyCause_MAX;
  return event;
}

void expect_same(const protocol::Event& event, const protocol::Event& given) {
  EXPECT_EQ(event.event_robot_time_us, given.event_robot_time_us);
  EXPECT_EQ(event.kind, given.kind);
  EXPECT_EQ(event.cause, given.cause);
  EXPECT_EQ(event.sample_seq, given.sample_seq);
  EXPECT_EQ(event.mode, given.mode);
  EXPECT_EQ(event.sub_state, given.sub_state);
  EXPECT_EQ(event.position_m, given.position_m);
  EXPECT_EQ(event.value, given.value);
  EXPECT_EQ(event.emergency_id, given.emergency_id);
  EXPECT_EQ(event.command_id, given.command_id);
  EXPECT_EQ(event.emergency_cause, given.emergency_cause);
}

TEST(EventRing, GivesBackEveryFieldExactly) {
  EventRing ring;
  ring.push(full_event());
  ring.push(rheonaut_Event_init_zero);
  expect_same(ring.at(0), full_event());
  expect_same(ring.at(1), rheonaut_Event_init_zero);
}

TEST(EventRing, NumbersOnBeyondItsCapacityAndCountsWhatItLost) {
  EventRing ring;
  constexpr std::uint64_t kPushed = 3 * EventRing::kCapacity + 5;
  for (std::uint64_t seq = 0; seq < kPushed; ++seq) {
    protocol::Event event = full_event();
    event.command_id = 1000 + seq;
    ring.push(event);
  }
  EXPECT_EQ(ring.next_seq(), kPushed);
  EXPECT_EQ(ring.oldest_seq(), kPushed - EventRing::kCapacity);
  EXPECT_EQ(ring.lost(), kPushed - EventRing::kCapacity);
  for (std::uint64_t seq = ring.oldest_seq(); seq < kPushed; ++seq) {
    EXPECT_EQ(ring.at(seq).event_seq, seq);
    EXPECT_EQ(ring.at(seq).oldest_event_seq, ring.oldest_seq());
    EXPECT_EQ(ring.at(seq).command_id, 1000 + seq);
  }
}

TEST(EventRing, ForgetsWhatIsAcknowledgedAndLosesNothingByIt) {
  EventRing ring;
  for (std::size_t i = 0; i < EventRing::kCapacity; ++i) ring.push(full_event());
  ring.acknowledge(EventRing::kCapacity + 1);  // never made
  EXPECT_EQ(ring.oldest_seq(), 0u);
  ring.acknowledge(2);
  ring.push(full_event());
  ring.push(full_event());
  EXPECT_EQ(ring.oldest_seq(), 2u);
  EXPECT_EQ(ring.lost(), 0u);
}

}  // namespace
}  // namespace robot_fw
