// Which acknowledgements are kept when more are due than there is room for.
#include "robot_fw/core/outbox.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace robot_fw {
namespace {

// An outbox on a link that is up. An ack is known by its number.
class Acks : public ::testing::Test {
 protected:
  using Numbers = std::vector<std::uint64_t>;

  Acks() {
    link.opened(0);
    link.welcomed(rheonaut_Welcome_init_zero, protocol::kDefaultLinkTimeoutMs, 0);
  }
  static protocol::CommandAck numbered(std::uint64_t number) {
    protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
    ack.command_id = number;
    return ack;
  }
  void ack(std::uint64_t first, std::uint64_t last) {
    for (std::uint64_t i = first; i <= last; ++i) outbox.ack(numbered(i));
  }
  void ack_stop(std::uint64_t first, std::uint64_t last) {
    for (std::uint64_t i = first; i <= last; ++i) outbox.ack_stop(numbered(i));
  }
  Numbers sent() {
    Numbers numbers;
    while (outbox.next(link, samples, events, 5, 0) == Outgoing::ack) {
      numbers.push_back(outbox.first_ack().command_id);
      outbox.sent(Outgoing::ack, 0, 0);
    }
    return numbers;
  }

  Link link;
  TelemetryRing samples;
  EventRing events;
  Outbox outbox;
};

TEST_F(Acks, OfStopsGoFirst) {
  ack(1, 2);
  ack_stop(3, 3);
  EXPECT_EQ(sent(), (Numbers{3, 1, 2}));
}

// SAFETY: the answer to a probe is worth nothing unless it goes where the ack of a stop would, and it delays none.
TEST_F(Acks, OfStopsGoBeforeTheAnswerToAStopProbeAndAllOthersAfterIt) {
  ack(1, 1);
  outbox.answer_stop_probe(500);
  ack_stop(3, 3);
  EXPECT_EQ(sent(), Numbers{3});
  ASSERT_EQ(outbox.next(link, samples, events, 5, 0), Outgoing::stop_probe_answer);
  EXPECT_EQ(outbox.stop_probe_us(), 500u);
  outbox.sent(Outgoing::stop_probe_answer, 0, 0);
  EXPECT_EQ(sent(), Numbers{1});
}

TEST_F(Acks, AStopProbeOfAnEarlierConnectionIsNotAnswered) {
  outbox.answer_stop_probe(500);
  outbox.welcomed(samples, events);
  EXPECT_NE(outbox.next(link, samples, events, 5, 0), Outgoing::stop_probe_answer);
}

TEST_F(Acks, TheOldestMakesRoom) {
  ack(1, 10);
  EXPECT_EQ(sent(), (Numbers{3, 4, 5, 6, 7, 8, 9, 10}));
}

TEST_F(Acks, OfAStopOutlivesAnyNumberOfOthers) {
  ack_stop(100, 100);
  ack(1, 40);
  EXPECT_EQ(sent(), (Numbers{100, 34, 35, 36, 37, 38, 39, 40}));
}

TEST_F(Acks, OfAStopTakesThePlaceOfTheOldestOther) {
  ack(1, 8);
  ack_stop(100, 100);
  EXPECT_EQ(sent(), (Numbers{100, 2, 3, 4, 5, 6, 7, 8}));
}

TEST_F(Acks, AmongNothingButStopsAnotherIsNotKept) {
  ack_stop(101, 108);
  ack(1, 3);
  EXPECT_EQ(sent(), (Numbers{108, 107, 106, 105, 104, 103, 102, 101}));
}

TEST_F(Acks, OfTheLatestStopIsAlwaysKept) {
  ack_stop(101, 109);
  const Numbers kept = sent();
  EXPECT_EQ(kept.size(), Outbox::kMaxAcks);
  EXPECT_EQ(kept.front(), 109u);
  EXPECT_EQ(kept.back(), 102u);
}

TEST_F(Acks, SayAllThatTheyWereGiven) {
  protocol::CommandAck given = numbered(0xFEDC'BA98'7654'3210);
  given.result = rheonaut_COMMAND_RESULT_REJECTED;
  given.reason = rheonaut_REJECT_REASON_UNSUPPORTED;
  given.effect_at_robot_us = 250'000'000'000'000;  // eight years
  given.emergency_id = 0x8000'0000'0000'0001;
  outbox.ack_stop(given);
  const protocol::CommandAck ack = outbox.first_ack();
  EXPECT_EQ(ack.command_id, given.command_id);
  EXPECT_EQ(ack.result, given.result);
  EXPECT_EQ(ack.reason, given.reason);
  EXPECT_EQ(ack.effect_at_robot_us, given.effect_at_robot_us);
  EXPECT_EQ(ack.emergency_id, given.emergency_id);
}

}  // namespace
}  // namespace robot_fw
