// Who gets in at a port whose places are few, and who gives way.
#include "server/net/door.hpp"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <sstream>

#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

class DoorTest : public ::testing::Test {
 protected:
  struct Visitor {
    std::unique_ptr<Guest> guest;
    bool ended = false;
  };

  DoorTest() {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  }
  ~DoorTest() override { spdlog::set_default_logger(before); }

  // Null when refused.
  Visitor* come(const std::string& address, Guest::State state = Guest::stranger, bool from_loopback = false) {
    auto guest = door.admit(address, from_loopback);
    if (!guest) {
      refusal = guest.error();
      return nullptr;
    }
    visitors.push_back(std::make_unique<Visitor>());
    Visitor* visitor = visitors.back().get();
    visitor->guest = std::move(*guest);
    visitor->guest->on_end([visitor] { visitor->ended = true; });
    visitor->guest->becomes(state);
    return visitor;
  }
  // Whoever was ended goes, as its task does at the loop's next turn.
  void go() {
    for (const auto& visitor : visitors) {
      if (visitor->ended) visitor->guest.reset();
    }
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  Door door{clock, "test port", {8, 6, 3, 6}};
  std::vector<std::unique_ptr<Visitor>> visitors;
  std::optional<Door::Refusal> refusal;
  std::ostringstream log;
  std::shared_ptr<spdlog::logger> before = spdlog::default_logger();
};

TEST_F(DoorTest, AnAddressWithItsShareGivesUpItsOldestStranger) {
  Visitor* first = come("10.0.0.1");
  Visitor* second = come("10.0.0.1");
  come("10.0.0.1", Guest::busy);
  Visitor* other = come("10.0.0.2");
  EXPECT_NE(come("10.0.0.1"), nullptr);
  EXPECT_TRUE(first->ended);
  EXPECT_FALSE(second->ended || other->ended);
  EXPECT_NE(come("10.0.0.1"), nullptr);
  EXPECT_TRUE(second->ended);
  EXPECT_EQ(door.counters().replaced, 2U);
  go();
  EXPECT_EQ(door.connections(), 4U);
}

TEST_F(DoorTest, AnIdleOneGivesWayWhenThereIsNoStrangerAndABusyOneNever) {
  Visitor* idle = come("10.0.0.1", Guest::idle);
  Visitor* later = come("10.0.0.1", Guest::idle);
  come("10.0.0.1", Guest::busy);
  idle->guest->becomes(Guest::busy);
  idle->guest->rest();  // now it is the other that is idle the longest
  EXPECT_NE(come("10.0.0.1", Guest::busy), nullptr);
  EXPECT_TRUE(later->ended);
  EXPECT_NE(come("10.0.0.1", Guest::busy), nullptr);
  EXPECT_TRUE(idle->ended);
  EXPECT_EQ(come("10.0.0.1"), nullptr);
  EXPECT_EQ(refusal, Door::Refusal::address_has_its_share);
  EXPECT_NE(come("10.0.0.2"), nullptr) << "nobody else is kept out";
  EXPECT_EQ(door.counters().refused, 1U);
}

// SAFETY: whoever has most strangers loses one, and the one who came alone to stop a robot stays.
TEST_F(DoorTest, AFullDoorTakesTheStrangerOfWhoeverHasMost) {
  Visitor* alone = come("10.0.0.9");
  Visitor* of_two = come("10.0.0.2");
  come("10.0.0.2");
  Visitor* of_three = come("10.0.0.1");
  come("10.0.0.1");
  come("10.0.0.1");
  EXPECT_NE(come("10.0.0.3"), nullptr) << "strangers have 6 places";
  EXPECT_TRUE(of_three->ended);
  EXPECT_FALSE(alone->ended || of_two->ended);
  EXPECT_NE(come("10.0.0.4"), nullptr);
  EXPECT_TRUE(of_two->ended) << "of two with as many, the older one";
  EXPECT_FALSE(alone->ended);
}

TEST_F(DoorTest, AFullDoorWithNobodyWhoMayGoRefuses) {
  for (int i = 0; i < 8; ++i) ASSERT_NE(come("10.0.0." + std::to_string(i), Guest::busy), nullptr);
  EXPECT_EQ(come("10.0.0.9"), nullptr);
  EXPECT_EQ(refusal, Door::Refusal::full);
  visitors.pop_back();
  EXPECT_NE(come("10.0.0.9"), nullptr);
}

TEST_F(DoorTest, AddressesOfThisMachineHaveMoreAndNotAll) {
  for (int i = 0; i < 6; ++i) ASSERT_NE(come("127.0.0.1", Guest::busy, true), nullptr);
  EXPECT_EQ(come("127.0.0.1", Guest::stranger, true), nullptr);
  EXPECT_NE(come("10.0.0.1"), nullptr);
}

TEST_F(DoorTest, ANetworkOfIpv6IsOneAddress) {
  for (int i = 0; i < 3; ++i) come("2001:db8:1:2::" + std::to_string(i), Guest::busy);
  EXPECT_EQ(come("2001:db8:1:2:ffff::1"), nullptr);
  EXPECT_NE(come("2001:db8:1:3::1"), nullptr);
}

TEST_F(DoorTest, WhoWasEndedHasNoSayAnyMore) {
  Visitor* first = come("10.0.0.1");
  come("10.0.0.1");
  come("10.0.0.1");
  come("10.0.0.1");
  ASSERT_TRUE(first->ended);
  first->guest->becomes(Guest::busy);
  EXPECT_EQ(door.connections(), 4U);
  EXPECT_NE(come("10.0.0.1", Guest::busy), nullptr) << "it does not count";
  go();
  EXPECT_EQ(door.connections(), 3U);
}

// Each still has its descriptor; a flood that is faster than they go does not grow them without bound.
TEST_F(DoorTest, ThoseWhoLeaveAreBounded) {
  for (int i = 0; i < 1000; ++i) come("10.0.0.1");
  EXPECT_EQ(door.connections(), 3U + 64U);
  EXPECT_EQ(door.counters().refused, 1000U - 3U - 64U);
  go();
  EXPECT_NE(come("10.0.0.1"), nullptr);
}

TEST_F(DoorTest, RefusalsAreLoggedOnceASecond) {
  for (int i = 0; i < 3; ++i) come("10.0.0.1", Guest::busy);
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
