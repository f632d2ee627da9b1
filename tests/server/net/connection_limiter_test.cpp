// Who gets in at a port whose places are few, and who gives way.
#include "server/net/connection_limiter.hpp"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <sstream>

#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

class ConnectionLimiterTest : public ::testing::Test {
 protected:
  struct Visitor {
    std::unique_ptr<net::ConnectionSlot> slot;
    bool ended = false;
  };

  ConnectionLimiterTest() {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  }
  ~ConnectionLimiterTest() override { spdlog::set_default_logger(before); }

  // Null when refused.
  Visitor* come(const std::string& address, net::ConnectionSlot::State state = net::ConnectionSlot::unauthenticated,
                bool from_loopback = false) {
    auto slot = limiter.admit(address, from_loopback);
    if (!slot) {
      refusal = slot.error();
      return nullptr;
    }
    visitors.push_back(std::make_unique<Visitor>());
    Visitor* visitor = visitors.back().get();
    visitor->slot = std::move(*slot);
    visitor->slot->on_end([visitor] { visitor->ended = true; });
    visitor->slot->becomes(state);
    return visitor;
  }
  // An evicted connection leaves, as its task does at the loop's next turn.
  void go() {
    for (const auto& visitor : visitors) {
      if (visitor->ended) visitor->slot.reset();
    }
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  net::ConnectionLimiter limiter{clock, "test port", {8, 6, 3, 6}};
  std::vector<std::unique_ptr<Visitor>> visitors;
  std::optional<net::ConnectionLimiter::Refusal> refusal;
  std::ostringstream log;
  std::shared_ptr<spdlog::logger> before = spdlog::default_logger();
};

TEST_F(ConnectionLimiterTest, AnAddressWithItsShareGivesUpItsOldestUnauthenticated) {
  Visitor* first = come("10.0.0.1");
  Visitor* second = come("10.0.0.1");
  come("10.0.0.1", net::ConnectionSlot::busy);
  Visitor* other = come("10.0.0.2");
  EXPECT_NE(come("10.0.0.1"), nullptr);
  EXPECT_TRUE(first->ended);
  EXPECT_FALSE(second->ended || other->ended);
  EXPECT_NE(come("10.0.0.1"), nullptr);
  EXPECT_TRUE(second->ended);
  EXPECT_EQ(limiter.counters().replaced, 2U);
  go();
  EXPECT_EQ(limiter.connections(), 4U);
}

TEST_F(ConnectionLimiterTest, AnIdleOneIsEndedWhenAllAreAuthenticatedAndABusyOneNever) {
  Visitor* idle = come("10.0.0.1", net::ConnectionSlot::idle);
  Visitor* later = come("10.0.0.1", net::ConnectionSlot::idle);
  come("10.0.0.1", net::ConnectionSlot::busy);
  idle->slot->becomes(net::ConnectionSlot::busy);
  idle->slot->rest();  // now it is the other that is idle the longest
  EXPECT_NE(come("10.0.0.1", net::ConnectionSlot::busy), nullptr);
  EXPECT_TRUE(later->ended);
  EXPECT_NE(come("10.0.0.1", net::ConnectionSlot::busy), nullptr);
  EXPECT_TRUE(idle->ended);
  EXPECT_EQ(come("10.0.0.1"), nullptr);
  EXPECT_EQ(refusal, net::ConnectionLimiter::Refusal::address_has_its_share);
  EXPECT_NE(come("10.0.0.2"), nullptr) << "nobody else is kept out";
  EXPECT_EQ(limiter.counters().refused, 1U);
}

// SAFETY: the address with most unauthenticated connections loses one; a single client that stops a robot stays.
TEST_F(ConnectionLimiterTest, AFullLimiterEvictsFromTheAddressWithMostUnauthenticated) {
  Visitor* alone = come("10.0.0.9");
  Visitor* of_two = come("10.0.0.2");
  come("10.0.0.2");
  Visitor* of_three = come("10.0.0.1");
  come("10.0.0.1");
  come("10.0.0.1");
  EXPECT_NE(come("10.0.0.3"), nullptr) << "unauthenticated have 6 places";
  EXPECT_TRUE(of_three->ended);
  EXPECT_FALSE(alone->ended || of_two->ended);
  EXPECT_NE(come("10.0.0.4"), nullptr);
  EXPECT_TRUE(of_two->ended) << "of two with as many, the older one";
  EXPECT_FALSE(alone->ended);
}

TEST_F(ConnectionLimiterTest, AFullLimiterWithNobodyWhoMayGoRefuses) {
  for (int i = 0; i < 8; ++i) ASSERT_NE(come("10.0.0." + std::to_string(i), net::ConnectionSlot::busy), nullptr);
  EXPECT_EQ(come("10.0.0.9"), nullptr);
  EXPECT_EQ(refusal, net::ConnectionLimiter::Refusal::full);
  visitors.pop_back();
  EXPECT_NE(come("10.0.0.9"), nullptr);
}

// SAFETY: whoever takes all places by questions that wait, or by answers that they do not take, makes room themselves.
TEST_F(ConnectionLimiterTest, QuestionsThatWaitAndAnswersThatStandStillGiveWayInTheirOrder) {
  Visitor* polls = come("10.0.0.1", net::ConnectionSlot::waiting);
  Visitor* slow = come("10.0.0.1", net::ConnectionSlot::sending);
  Visitor* polls_too = come("10.0.0.1", net::ConnectionSlot::waiting);
  for (int i = 2; i < 7; ++i) ASSERT_NE(come("10.0.0." + std::to_string(i), net::ConnectionSlot::busy), nullptr);
  clock.run_for(std::chrono::seconds{2});
  EXPECT_NE(come("10.0.0.9", net::ConnectionSlot::busy), nullptr);
  EXPECT_TRUE(polls->ended && !polls_too->ended && !slow->ended) << "the oldest question";
  EXPECT_NE(come("10.0.0.9", net::ConnectionSlot::busy), nullptr);
  EXPECT_TRUE(polls_too->ended && !slow->ended);
  EXPECT_NE(come("10.0.0.9", net::ConnectionSlot::busy), nullptr);
  EXPECT_TRUE(slow->ended);
  EXPECT_EQ(come("10.0.1.1"), nullptr) << "only busy ones are left";
}

TEST_F(ConnectionLimiterTest, AnAnswerThatMovesStaysAndOfTheOthersTheSlowestGoes) {
  Visitor* fast = come("10.0.0.1", net::ConnectionSlot::sending);
  Visitor* slow = come("10.0.0.1", net::ConnectionSlot::sending);
  Visitor* slower = come("10.0.0.1", net::ConnectionSlot::sending);
  clock.run_for(std::chrono::seconds{2});
  fast->slot->moved(net::kSlowAnswer);
  slow->slot->moved(net::kSlowAnswer / 2);
  slower->slot->moved(1);
  EXPECT_NE(come("10.0.0.1", net::ConnectionSlot::busy), nullptr);
  EXPECT_TRUE(slower->ended && !slow->ended && !fast->ended);
  EXPECT_NE(come("10.0.0.1", net::ConnectionSlot::busy), nullptr);
  EXPECT_TRUE(slow->ended);
  EXPECT_EQ(come("10.0.0.1"), nullptr);
  clock.run_for(std::chrono::seconds{2});
  EXPECT_NE(come("10.0.0.1"), nullptr) << "it stands still now";
  EXPECT_TRUE(fast->ended);
}

TEST_F(ConnectionLimiterTest, WhoHasMostPlacesLosesOneAndBusyOnesDoNotCount) {
  for (int i = 0; i < 3; ++i) come("10.0.0.1", net::ConnectionSlot::busy);  // pages of a laboratory
  Visitor* of_the_lab = come("10.0.0.2", net::ConnectionSlot::waiting);
  std::vector<Visitor*> of_an_attacker;
  for (int i = 0; i < 3; ++i) of_an_attacker.push_back(come("10.0.0.3", net::ConnectionSlot::waiting));
  come("10.0.0.4", net::ConnectionSlot::busy);
  EXPECT_NE(come("10.0.0.5"), nullptr);
  EXPECT_TRUE(of_an_attacker[0]->ended);
  EXPECT_NE(come("10.0.0.5"), nullptr);
  EXPECT_TRUE(of_an_attacker[1]->ended);
  EXPECT_FALSE(of_the_lab->ended);
}

// SAFETY: where nobody can give way, a stop and a look at its health still find a place.
TEST(ConnectionReserve, IsBeyondTheLimitsAndUnderTheSameRule) {
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  net::ConnectionLimiter limiter{clock, "test port", {2, 2, 2, 2, 2}};
  std::vector<std::unique_ptr<net::ConnectionSlot>> slots;
  std::vector<bool> ended(9);
  const auto come = [&](const char* address, bool is_busy) -> bool {
    auto slot = limiter.admit(address, false);
    if (!slot) return false;
    (*slot)->on_end([&ended, at = slots.size()] { ended[at] = true; });
    if (is_busy) (*slot)->becomes(net::ConnectionSlot::busy);
    slots.push_back(std::move(*slot));
    return true;
  };
  ASSERT_TRUE(come("10.0.0.1", true) && come("10.0.0.1", true));
  EXPECT_FALSE(slots[1]->is_reserve());
  ASSERT_TRUE(come("10.0.0.1", false) && come("10.0.0.1", false)) << "its share holds for the others";
  EXPECT_TRUE(slots[2]->is_reserve() && slots[3]->is_reserve());
  ASSERT_TRUE(come("10.0.0.2", true));
  EXPECT_TRUE(ended[2]) << "of the address with most of them, the oldest";
  ASSERT_TRUE(come("10.0.0.2", true));
  EXPECT_TRUE(ended[3]);
  EXPECT_FALSE(come("10.0.0.3", false)) << "both are at a stop";
}

TEST_F(ConnectionLimiterTest, AddressesOfThisMachineHaveMoreAndNotAll) {
  for (int i = 0; i < 6; ++i) ASSERT_NE(come("127.0.0.1", net::ConnectionSlot::busy, true), nullptr);
  EXPECT_EQ(come("127.0.0.1", net::ConnectionSlot::unauthenticated, true), nullptr);
  EXPECT_NE(come("10.0.0.1"), nullptr);
}

TEST_F(ConnectionLimiterTest, ANetworkOfIpv6IsOneAddress) {
  for (int i = 0; i < 3; ++i) come("2001:db8:1:2::" + std::to_string(i), net::ConnectionSlot::busy);
  EXPECT_EQ(come("2001:db8:1:2:ffff::1"), nullptr);
  EXPECT_NE(come("2001:db8:1:3::1"), nullptr);
}

TEST_F(ConnectionLimiterTest, WhoWasEndedHasNoSayAnyMore) {
  Visitor* first = come("10.0.0.1");
  come("10.0.0.1");
  come("10.0.0.1");
  come("10.0.0.1");
  ASSERT_TRUE(first->ended);
  first->slot->becomes(net::ConnectionSlot::busy);
  EXPECT_EQ(limiter.connections(), 4U);
  EXPECT_NE(come("10.0.0.1", net::ConnectionSlot::busy), nullptr) << "it does not count";
  go();
  EXPECT_EQ(limiter.connections(), 3U);
}

// Each still has its descriptor; a flood that is faster than they go does not grow them without bound.
TEST_F(ConnectionLimiterTest, ThoseWhoLeaveAreBounded) {
  for (int i = 0; i < 1000; ++i) come("10.0.0.1");
  EXPECT_EQ(limiter.connections(), 3U + net::kMaxLeaving);
  EXPECT_EQ(limiter.counters().refused, 1000U - 3U - net::kMaxLeaving);
  go();
  EXPECT_NE(come("10.0.0.1"), nullptr);
}

TEST_F(ConnectionLimiterTest, RefusalsAreLoggedOnceASecond) {
  for (int i = 0; i < 3; ++i) come("10.0.0.1", net::ConnectionSlot::busy);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(come("10.0.0.1"), nullptr);
  clock.run_for(std::chrono::seconds{1});
  EXPECT_EQ(come("10.0.0.1"), nullptr);
  const std::string said = log.str();
  EXPECT_EQ(std::ranges::count(said, '\n'), 2) << said;
  EXPECT_NE(said.find("test port: 10.0.0.1 refused, its address has its share"), std::string::npos) << said;
  EXPECT_NE(said.find("(and 19 before)"), std::string::npos) << said;
}

}  // namespace
}  // namespace server
