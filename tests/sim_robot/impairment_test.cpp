// One impaired direction: when its bytes arrive, that each of them does, once and in order, and what it holds.
#include "sim_robot/network/impairment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>

namespace sim_robot {
namespace {

constexpr std::uint64_t kMsUs = 1000, kSUs = 1'000'000;

std::vector<std::uint8_t> numbered(std::size_t count) {
  std::vector<std::uint8_t> bytes(count);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  return bytes;
}

struct Arrival {
  std::uint64_t at_us;
  std::size_t size;

  bool operator==(const Arrival&) const = default;
};

class ImpairedStreamTest : public ::testing::Test {
 protected:
  static Impairment with(auto change) {
    Impairment impairment;
    impairment.buffer_bytes = 1'000'000;
    change(impairment);
    return impairment;
  }
  static std::size_t push(ImpairedStream& stream, const std::vector<std::uint8_t>& bytes, std::uint64_t now_us) {
    return stream.push({bytes.data(), bytes.size()}, now_us);
  }
  // Everything that arrives up to a time, at the moment at which it is due.
  void take_until(ImpairedStream& stream, std::uint64_t end_us) {
    while (stream.next_at_us() && *stream.next_at_us() <= end_us) {
      const std::uint64_t now_us = *stream.next_at_us();
      std::uint8_t bytes[256];
      const std::size_t size = stream.pull(bytes, sizeof bytes, now_us);
      if (size == 0) return;  // the end
      arrivals.push_back({now_us, size});
      received.insert(received.end(), bytes, bytes + size);
    }
  }

  std::vector<Arrival> arrivals;
  std::vector<std::uint8_t> received;
};

TEST_F(ImpairedStreamTest, WithoutFaultsBytesAreThereAtOnce) {
  ImpairedStream stream{{}, 1};
  EXPECT_EQ(push(stream, numbered(10), 5), 10u);
  take_until(stream, 5);
  EXPECT_EQ(arrivals, (std::vector<Arrival>{{5, 10}}));
  EXPECT_EQ(received, numbered(10));
  EXPECT_FALSE(stream.next_at_us());
}

TEST_F(ImpairedStreamTest, DelayIsTheSameForAll) {
  ImpairedStream stream{with([](auto& i) { i.delay_s = 0.08; }), 1};
  push(stream, numbered(3), 0);
  push(stream, numbered(4), 10 * kMsUs);
  std::uint8_t byte = 0;
  EXPECT_EQ(stream.pull(&byte, 1, 80 * kMsUs - 1), 0u);
  take_until(stream, kSUs);
  EXPECT_EQ(arrivals, (std::vector<Arrival>{{80 * kMsUs, 3}, {90 * kMsUs, 4}}));
}

TEST_F(ImpairedStreamTest, JitterStaysWithinItsRangeAndOvertakesNothing) {
  ImpairedStream stream{with([](auto& i) { i.delay_s = 0.1, i.jitter_s = 0.05; }), 7};
  for (std::uint64_t i = 0; i < 200; ++i) push(stream, {static_cast<std::uint8_t>(i)}, i * 100 * kMsUs);
  take_until(stream, 100 * kSUs);
  ASSERT_EQ(arrivals.size(), 200u);
  std::uint64_t least_us = kSUs, most_us = 0;
  for (std::uint64_t i = 0; i < 200; ++i) {
    EXPECT_EQ(received[i], static_cast<std::uint8_t>(i));
    least_us = std::min(least_us, arrivals[i].at_us - i * 100 * kMsUs);
    most_us = std::max(most_us, arrivals[i].at_us - i * 100 * kMsUs);
  }
  EXPECT_GE(least_us, 100 * kMsUs);
  EXPECT_LE(most_us, 150 * kMsUs);
  EXPECT_LT(least_us, 105 * kMsUs);
  EXPECT_GT(most_us, 145 * kMsUs);
}

TEST_F(ImpairedStreamTest, ThrottleLetsItsRatePass) {
  ImpairedStream stream{with([](auto& i) { i.bytes_per_s = 5000; }), 1};
  push(stream, numbered(20'000), 0);
  take_until(stream, kSUs);
  EXPECT_NEAR(static_cast<double>(received.size()), 5000, 100);
  take_until(stream, 4 * kSUs);
  EXPECT_EQ(received, numbered(20'000));
  EXPECT_EQ(arrivals.back().at_us, 4 * kSUs);
}

TEST_F(ImpairedStreamTest, AThrottleThatIsLiftedLetsGoWhatWaits) {
  ImpairedStream stream{with([](auto& i) { i.bytes_per_s = 100; }), 1};
  push(stream, numbered(1000), 0);
  take_until(stream, 2 * kSUs);
  EXPECT_EQ(received.size(), 200u);
  stream.impair({}, 2 * kSUs);
  push(stream, {7}, 2 * kSUs);
  take_until(stream, 2 * kSUs + 10 * kMsUs);
  EXPECT_EQ(received.size(), 1001u);
  EXPECT_EQ(received.back(), 7);
}

TEST_F(ImpairedStreamTest, ALossIsAStallOfATimeoutThatDoublesAndHoldsUpWhatFollows) {
  ImpairedStream stream{with([](auto& i) { i.loss_probability = 0.5; }), 3};
  for (std::uint64_t i = 0; i < 500; ++i) push(stream, {0}, i * 100 * kSUs);
  take_until(stream, ImpairedStream::kNever);
  ASSERT_EQ(arrivals.size(), 500u);
  std::map<std::uint64_t, int> stalls;
  for (std::uint64_t i = 0; i < 500; ++i) ++stalls[(arrivals[i].at_us - i * 100 * kSUs) / kMsUs];
  EXPECT_NEAR(stalls[0], 250, 40);
  EXPECT_NEAR(stalls[200], 125, 35);
  EXPECT_NEAR(stalls[600], 63, 25);
  EXPECT_NEAR(stalls[1400], 31, 20);
  for (const auto& [stall_ms, count] : stalls) EXPECT_EQ((stall_ms / 200 + 1) & (stall_ms / 200), 0u) << stall_ms;
}

TEST_F(ImpairedStreamTest, SplitGivesEveryByteByItself) {
  ImpairedStream stream{with([](auto& i) { i.split_bytes = 1; }), 1};
  push(stream, numbered(300), 0);
  take_until(stream, 0);
  EXPECT_EQ(arrivals.size(), 300u);
  EXPECT_EQ(received, numbered(300));
}

TEST_F(ImpairedStreamTest, AFullBufferTakesNoMore) {
  Impairment impairment;
  impairment.delay_s = 0.1;
  impairment.buffer_bytes = 100;
  ImpairedStream stream{impairment, 1};
  EXPECT_EQ(push(stream, numbered(60), 0), 60u);
  EXPECT_EQ(push(stream, numbered(60), 0), 40u);
  EXPECT_EQ(push(stream, numbered(60), 99 * kMsUs), 0u);
  take_until(stream, 100 * kMsUs);
  EXPECT_EQ(received.size(), 100u);
  EXPECT_EQ(stream.room(), 100u);
}

TEST_F(ImpairedStreamTest, AStallEndsWithTheNextRetransmission) {
  ImpairedStream stream{with([](auto&) {}), 1};
  stream.stall(0, 3 * kSUs);
  push(stream, numbered(1), 100 * kMsUs);
  push(stream, numbered(1), 2500 * kMsUs);
  take_until(stream, 10 * kSUs);  // sent again at 0.3, 0.7, 1.5 and 3.1 s
  EXPECT_EQ(arrivals, (std::vector<Arrival>{{3100 * kMsUs, 2}}));
}

TEST_F(ImpairedStreamTest, AStallHoldsWhatIsUnderWayButNotWhatHasArrived) {
  ImpairedStream stream{with([](auto& i) { i.delay_s = 0.1; }), 1};
  push(stream, numbered(5), 0);
  push(stream, numbered(6), 60 * kMsUs);
  stream.stall(110 * kMsUs, kSUs);
  take_until(stream, 200 * kMsUs);
  EXPECT_EQ(received.size(), 5u);
  stream.resume(300 * kMsUs);
  push(stream, numbered(7), 300 * kMsUs);
  take_until(stream, kSUs);
  EXPECT_EQ(arrivals, (std::vector<Arrival>{{100 * kMsUs, 5}, {300 * kMsUs, 6}, {400 * kMsUs, 7}}));
}

TEST_F(ImpairedStreamTest, ALongerStallReplacesAShorterOne) {
  ImpairedStream stream{with([](auto&) {}), 1};
  stream.stall(0, kSUs);
  push(stream, numbered(1), 0);
  stream.stall(500 * kMsUs, 20 * kSUs);
  take_until(stream, 19 * kSUs);
  EXPECT_TRUE(received.empty());
  take_until(stream, 60 * kSUs);
  EXPECT_EQ(received.size(), 1u);
}

TEST_F(ImpairedStreamTest, HalfOpenSwallowsWhatItHoldsForEver) {
  Impairment impairment;
  impairment.buffer_bytes = 50;
  ImpairedStream stream{impairment, 1};
  stream.stall(0, ImpairedStream::kNever);
  EXPECT_EQ(push(stream, numbered(60), kSUs), 50u);
  stream.close(kSUs);
  EXPECT_FALSE(stream.next_at_us());
  EXPECT_FALSE(stream.ended(1000 * kSUs));
  std::uint8_t byte = 0;
  EXPECT_EQ(stream.pull(&byte, 1, 1000 * kSUs), 0u);
}

TEST_F(ImpairedStreamTest, TheEndComesAfterTheLastByte) {
  ImpairedStream stream{with([](auto& i) { i.delay_s = 0.1; }), 1};
  push(stream, numbered(3), 0);
  stream.close(50 * kMsUs);
  EXPECT_EQ(push(stream, numbered(3), 60 * kMsUs), 0u);
  take_until(stream, 149 * kMsUs);
  EXPECT_EQ(received.size(), 3u);
  EXPECT_FALSE(stream.ended(149 * kMsUs));
  EXPECT_TRUE(stream.ended(150 * kMsUs));
}

TEST_F(ImpairedStreamTest, ACutLeavesAsManyBytesAsItSays) {
  for (const std::size_t left : {0U, 1U, 9U, 1999U, 2000U, 5000U}) {
    received.clear();
    ImpairedStream stream{with([](auto& i) { i.delay_s = 0.1; }), 1};
    push(stream, numbered(2000), 0);
    stream.cut(left, 0);
    take_until(stream, kSUs);
    EXPECT_EQ(received, numbered(std::min<std::size_t>(left, 2000)));
    EXPECT_TRUE(stream.ended(100 * kMsUs));
  }
}

// Drives a stream as hard as it takes, with faults that come and go, and gives the times of everything that arrived.
std::vector<Arrival> storm(std::uint64_t seed, std::vector<std::uint8_t>& received) {
  std::mt19937_64 random{seed};
  const auto up_to = [&random](double most) { return std::uniform_real_distribution<double>{0, most}(random); };
  const auto any = [&] {
    Impairment impairment;
    impairment.delay_s = up_to(0.4);
    impairment.jitter_s = up_to(0.3);
    impairment.bytes_per_s = up_to(1) < 0.5 ? 0 : 300 + up_to(20'000);
    impairment.loss_probability = up_to(0.5);
    impairment.split_bytes = static_cast<std::size_t>(up_to(20));
    impairment.buffer_bytes = 1 + static_cast<std::size_t>(up_to(5000));
    return impairment;
  };
  const auto sent = numbered(20'000);
  ImpairedStream stream{any(), seed};
  std::vector<Arrival> arrivals;
  std::size_t pushed = 0;
  for (std::uint64_t now_us = 0; received.size() < sent.size() && now_us < 36'000 * kSUs; now_us += 10 * kMsUs) {
    if (up_to(1) < 0.002) stream.impair(any(), now_us);
    if (up_to(1) < 0.002) stream.stall(now_us, now_us + static_cast<std::uint64_t>(up_to(2e6)));
    if (up_to(1) < 0.0005) stream.stall(now_us, ImpairedStream::kNever);
    if (up_to(1) < 0.01) stream.resume(now_us);
    const auto offered = std::min<std::size_t>(sent.size() - pushed, static_cast<std::size_t>(up_to(800)));
    pushed += stream.push({sent.data() + pushed, offered}, now_us);
    std::uint8_t bytes[64];
    while (const std::size_t size = stream.pull(bytes, sizeof bytes, now_us)) {
      arrivals.push_back({now_us, size});
      received.insert(received.end(), bytes, bytes + size);
    }
    EXPECT_EQ(stream.held(), pushed - received.size());
  }
  EXPECT_EQ(received, sent) << "seed " << seed;
  return arrivals;
}

TEST_F(ImpairedStreamTest, EveryByteArrivesOnceAndInOrderWhateverTheSettings) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    std::vector<std::uint8_t> bytes;
    storm(seed, bytes);
  }
}

TEST_F(ImpairedStreamTest, TheSameSeedGivesTheSameTimes) {
  std::vector<std::uint8_t> first, again, other;
  const auto times = storm(5, first);
  EXPECT_EQ(times, storm(5, again));
  EXPECT_NE(times, storm(6, other));
}

TEST(CheckImpairment, NamesAndQuotesWhatCannotBe) {
  const auto message = [](auto change) -> std::string {
    Impairment impairment;
    change(impairment);
    try {
      check(impairment);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message([](auto&) {}), "");
  EXPECT_NE(message([](auto& i) { i.delay_s = -1; }).find("delay_s -1"), std::string::npos);
  EXPECT_NE(message([](auto& i) { i.jitter_s = NAN; }).find("jitter_s nan"), std::string::npos);
  EXPECT_NE(message([](auto& i) { i.bytes_per_s = -5; }).find("bytes_per_s"), std::string::npos);
  EXPECT_NE(message([](auto& i) { i.loss_probability = 1; }).find("loss_probability 1"), std::string::npos);
  EXPECT_NE(message([](auto& i) { i.retransmit_s = 0; }).find("retransmit_s"), std::string::npos);
  EXPECT_NE(message([](auto& i) { i.buffer_bytes = 0; }).find("buffer_bytes"), std::string::npos);
}

}  // namespace
}  // namespace sim_robot
