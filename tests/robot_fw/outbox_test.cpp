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

TEST_F(Acks, TheOldestMakesRoom) {
  ack(1, 18);
  EXPECT_EQ(sent(), (Numbers{3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18}));
}

TEST_F(Acks, OfAStopOutlivesAnyNumberOfOthers) {
  ack_stop(100, 100);
  ack(1, 40);
  EXPECT_EQ(sent(), (Numbers{100, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40}));
}

TEST_F(Acks, OfAStopTakesThePlaceOfTheOldestOther) {
  ack(1, 16);
  ack_stop(100, 100);
  EXPECT_EQ(sent(), (Numbers{100, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16}));
}

TEST_F(Acks, AmongNothingButStopsAnotherIsNotKept) {
  ack_stop(101, 116);
  ack(1, 3);
  EXPECT_EQ(sent(), (Numbers{116, 115, 114, 113, 112, 111, 110, 109, 108, 107, 106, 105, 104, 103, 102, 101}));
}

TEST_F(Acks, OfTheLatestStopIsAlwaysKept) {
  ack_stop(101, 117);
  const Numbers kept = sent();
  EXPECT_EQ(kept.size(), Outbox::kMaxAcks);
  EXPECT_EQ(kept.front(), 117u);
  EXPECT_EQ(kept.back(), 102u);
}

}  // namespace
}  // namespace robot_fw
