// Control of a robot: one at a time, ended by silence, handed over, forced.
#include "server/station/commands/authority.hpp"

#include <gtest/gtest.h>

#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;

class AuthorityTest : public ::testing::Test {
 protected:
  // From now on, or so much later, for an hour.
  void reserve(const std::string& holder, microseconds in = 0us) {
    station::Reservation slot;
    slot.id = 7;
    slot.robot_id = "r1";
    slot.holder = holder;
    slot.from_us = clock_.utc_us() + in.count();
    slot.until_us = slot.from_us + microseconds{1h}.count();
    reservations_.add(std::move(slot));
  }
  static std::string reason(const auto& result) { return result ? "" : result.error().reason; }
  static station::Client by(const char* actor, const char* id = "") { return {actor, id}; }

  boost::asio::io_context loop_;
  VirtualClock clock_{loop_};
  station::Reservations reservations_;
  station::Authority authority_{clock_, reservations_};
};

TEST_F(AuthorityTest, WhoCommandsFirstIsInControlAndAnotherIsRefusedByName) {
  const auto first = authority_.use("r1", by("session:1"));
  ASSERT_TRUE(first && *first);
  EXPECT_EQ((*first)->kind, "control_taken");
  EXPECT_FALSE(*authority_.use("r1", by("session:1"))) << "nothing new";
  const auto second = authority_.use("r1", by("session:2"));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().reason, "not_in_control");
  EXPECT_NE(second.error().detail.find("session:1"), std::string::npos);
  EXPECT_TRUE(authority_.use("r2", by("session:2"))) << "another robot";
  EXPECT_FALSE(authority_.take("r1", by("session:2"), station::kControlLease));
  EXPECT_EQ(authority_.of("r1").holder, "session:1");
}

TEST_F(AuthorityTest, EndsWithSilenceAndIsReportedOnce) {
  ASSERT_TRUE(authority_.use("r1", by("session:1")));
  clock_.run_for(station::kControlLease - 1us);
  EXPECT_FALSE(authority_.use("r1", by("session:2")));
  EXPECT_TRUE(authority_.expire().empty());
  clock_.run_for(1us);
  EXPECT_EQ(authority_.of("r1").holder, "");
  const auto changes = authority_.expire();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].kind, "control_expired");
  EXPECT_TRUE(authority_.expire().empty());
  EXPECT_TRUE(authority_.use("r1", by("session:2")));
}

TEST_F(AuthorityTest, ASignOfLifeKeepsWhatHasNotEnded) {
  ASSERT_TRUE(authority_.use("r1", by("session:1")));
  for (int i = 0; i < 10; ++i) {
    clock_.run_for(2s);
    authority_.keep_all_alive(by("session:1"));
    authority_.keep_all_alive(by("session:2"));
  }
  EXPECT_EQ(authority_.of("r1").holder, "session:1");
  clock_.run_for(station::kControlLease);
  authority_.keep_all_alive(by("session:1"));  // SAFETY: too late; what has ended stays ended
  EXPECT_EQ(authority_.of("r1").holder, "");
}

TEST_F(AuthorityTest, AScriptMaySayHowLongItTakes) {
  ASSERT_TRUE(authority_.take("r1", by("token:local"), 60s));
  clock_.run_for(59s);
  EXPECT_FALSE(authority_.use("r1", by("session:1")));
  ASSERT_TRUE(authority_.use("r1", by("token:local"))) << "a command shortens nothing";
  clock_.run_for(1s);
  EXPECT_FALSE(authority_.use("r1", by("session:1"))) << "and lasts 3 s at least";
  clock_.run_for(2s);
  EXPECT_TRUE(authority_.use("r1", by("session:1")));
}

TEST_F(AuthorityTest, IsReleasedByItsHolderOnly) {
  EXPECT_EQ(authority_.release("r1", "session:1").error().reason, "not_in_control");
  ASSERT_TRUE(authority_.use("r1", by("session:1")));
  EXPECT_FALSE(authority_.release("r1", "session:2"));
  EXPECT_TRUE(authority_.release("r1", "session:1"));
  EXPECT_TRUE(authority_.use("r1", by("session:2")));
}

TEST_F(AuthorityTest, IsHandedOverToWhoHasAsked) {
  EXPECT_EQ(authority_.request("r1", by("session:2")).error().reason, "control_is_free");
  ASSERT_TRUE(authority_.use("r1", by("session:1")));
  EXPECT_EQ(authority_.hand_over("r1", "session:1").error().reason, "not_requested");
  ASSERT_TRUE(authority_.request("r1", by("session:2")));
  EXPECT_EQ(authority_.of("r1").requested_by, "session:2");
  EXPECT_FALSE(authority_.hand_over("r1", "session:2")) << "who asks does not decide";
  ASSERT_TRUE(authority_.hand_over("r1", "session:1"));
  EXPECT_EQ(authority_.of("r1").holder, "session:2");
  EXPECT_EQ(authority_.of("r1").requested_by, "");
}

TEST_F(AuthorityTest, ARequestIsForgottenAfterAWhile) {
  ASSERT_TRUE(authority_.take("r1", by("session:1"), 300s));
  ASSERT_TRUE(authority_.request("r1", by("session:2")));
  clock_.run_for(station::kRequestTimeout);
  EXPECT_EQ(authority_.of("r1").requested_by, "");
  EXPECT_FALSE(authority_.hand_over("r1", "session:1"));
}

TEST_F(AuthorityTest, ForceTakesItWithAReason) {
  ASSERT_TRUE(authority_.take("r1", by("session:1"), 300s));
  const auto change = authority_.take_by_force("r1", by("session:2"), "the operator has left");
  EXPECT_EQ(change.kind, "control_forced");
  EXPECT_EQ(change.cause, "by session:2 from session:1: the operator has left");
  EXPECT_FALSE(authority_.use("r1", by("session:1")));
}

// SAFETY: each way to control, tried by somebody who is kept out.
TEST_F(AuthorityTest, WhileARobotIsReservedNobodyElseGetsControlOfIt) {
  reserve("user:anna");
  EXPECT_EQ(reason(authority_.may_use("r1", "user:ben/session:2")), "reserved");
  EXPECT_EQ(reason(authority_.use("r1", by("user:ben/session:2"))), "reserved");
  EXPECT_EQ(reason(authority_.take("r1", by("user:ben/session:2"), 3s)), "reserved");
  EXPECT_EQ(reason(authority_.request("r1", by("user:ben/session:2"))), "reserved");
  EXPECT_EQ(authority_.of("r1").holder, "");
  const std::string detail = authority_.may_use("r1", "user:ben/session:2").error().detail;
  EXPECT_NE(detail.find("reserved for user:anna until " + station::utc_text(clock_.utc_us() + 3'600'000'000)),
            std::string::npos)
      << detail;
  EXPECT_TRUE(authority_.may_use("r2", "user:ben/session:2"));
  ASSERT_TRUE(authority_.use("r1", by("user:anna/session:1")));
  EXPECT_EQ(reason(authority_.request("r1", by("user:ben/session:2"))), "reserved");
  EXPECT_EQ(reason(authority_.take("r1", by("user:anna/session:9"), 3s)), "not_in_control") << "one page at a time";
}

TEST_F(AuthorityTest, ASlotBeginsAndEndsInOneMoment) {
  reserve("user:anna", 10s);
  clock_.run_for(10s - 1us);
  EXPECT_TRUE(authority_.may_use("r1", "token:ci"));
  clock_.run_for(1us);
  EXPECT_EQ(reason(authority_.may_use("r1", "token:ci")), "reserved");
  clock_.run_for(1h - 1us);
  EXPECT_EQ(reason(authority_.may_use("r1", "token:ci")), "reserved");
  clock_.run_for(1us);
  EXPECT_TRUE(authority_.take("r1", by("token:ci"), 3s));
}

// SAFETY: at once, and before anybody looks.
TEST_F(AuthorityTest, ALeaseEndsWhenASlotOfSomebodyElseBeginsHoweverLongItIsAndHoweverOftenItIsRenewed) {
  ASSERT_TRUE(authority_.take("r1", by("token:ci"), 600s));
  reserve("user:anna", 10s);
  clock_.run_for(10s - 1us);
  EXPECT_EQ(authority_.of("r1").holder, "token:ci");
  clock_.run_for(1us);
  EXPECT_EQ(authority_.of("r1").holder, "");
  authority_.keep_all_alive(by("token:ci"));
  EXPECT_EQ(reason(authority_.use("r1", by("token:ci"))), "reserved");
  EXPECT_EQ(reason(authority_.release("r1", "token:ci")), "not_in_control");
  const auto changes = authority_.expire();
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_EQ(changes[0].kind, "control_ended_by_reservation");
  EXPECT_EQ(changes[0].cause, "of token:ci: the robot is reserved for user:anna");
  EXPECT_TRUE(authority_.expire().empty());
  EXPECT_TRUE(authority_.take("r1", by("user:anna/session:1"), 3s)) << "its holder waits for nobody";
}

TEST_F(AuthorityTest, TheHoldersLeaseGoesOnIntoTheSlot) {
  ASSERT_TRUE(authority_.take("r1", by("user:anna/session:1"), 60s));
  reserve("user:anna", 10s);
  clock_.run_for(20s);
  EXPECT_EQ(authority_.of("r1").holder, "user:anna/session:1");
  EXPECT_TRUE(authority_.expire().empty());
}

TEST_F(AuthorityTest, ControlIsHandedToNobodyWhoIsKeptOutByNow) {
  ASSERT_TRUE(authority_.take("r1", by("user:anna/session:1"), 60s));
  reserve("user:anna", 10s);
  ASSERT_TRUE(authority_.request("r1", by("token:ci"))) << "before the slot";
  clock_.run_for(10s);
  EXPECT_EQ(reason(authority_.hand_over("r1", "user:anna/session:1")), "reserved");
  EXPECT_EQ(authority_.of("r1").holder, "user:anna/session:1");
  ASSERT_TRUE(authority_.request("r1", by("user:anna/session:2")));
  EXPECT_TRUE(authority_.hand_over("r1", "user:anna/session:1"));
}

TEST_F(AuthorityTest, AnAdministratorsForceHoldsInASlotUntilItsLeaseEnds) {
  reserve("user:anna");
  ASSERT_TRUE(authority_.use("r1", by("user:anna/session:1")));
  authority_.take_by_force("r1", by("user:root/session:2"), "the tube leaks");
  EXPECT_EQ(authority_.of("r1").holder, "user:root/session:2");
  EXPECT_EQ(authority_.keeps_out("r1", "user:root/session:2", 1h), nullptr);
  for (int i = 0; i < 10; ++i) {
    clock_.run_for(2s);
    EXPECT_TRUE(authority_.use("r1", by("user:root/session:2")));
    authority_.keep_all_alive(by("user:root/session:2"));
    EXPECT_TRUE(authority_.take("r1", by("user:root/session:2"), 3s)) << "still by force";
  }
  EXPECT_EQ(reason(authority_.use("r1", by("user:anna/session:1"))), "not_in_control");
  EXPECT_EQ(reason(authority_.use("r1", by("user:root/session:3"))), "reserved")
      << "another page of theirs has not forced it";
  clock_.run_for(3s);
  EXPECT_EQ(reason(authority_.take("r1", by("user:root/session:2"), 3s)), "reserved") << "once it has ended";
  EXPECT_EQ(authority_.expire().at(0).kind, "control_expired");
  EXPECT_EQ(reason(authority_.take("r1", by("user:root/session:2"), 3s)), "reserved");
}

TEST_F(AuthorityTest, WhatIsHandedOverAfterAForceIsNoForce) {
  authority_.take_by_force("r1", by("user:root/session:2"), "to help");
  ASSERT_TRUE(authority_.request("r1", by("token:ci")));
  ASSERT_TRUE(authority_.hand_over("r1", "user:root/session:2"));
  ASSERT_TRUE(authority_.take("r1", by("token:ci"), 60s));
  reserve("user:anna", 10s);
  clock_.run_for(10s);
  EXPECT_EQ(authority_.of("r1").holder, "");
}

// SAFETY: two tabs of one session, or two programs with one token, are two.
TEST_F(AuthorityTest, OnlyTheClientThatCommandedLastKeepsControlAlive) {
  ASSERT_TRUE(authority_.use("r1", by("token:local", "script-one")));
  ASSERT_TRUE(authority_.use("r2", by("token:local", "script-two")));
  clock_.run_for(2s);
  authority_.keep_alive("r1", by("token:local", "script-two"));
  authority_.keep_alive("r1", by("token:local"));
  authority_.keep_all_alive(by("token:local", "script-two"));
  EXPECT_TRUE(authority_.is_kept_by("r1", by("token:local", "script-one")));
  EXPECT_FALSE(authority_.is_kept_by("r1", by("token:local", "script-two")));
  clock_.run_for(1s);
  EXPECT_EQ(authority_.of("r1").holder, "") << "its own client was silent";
  EXPECT_EQ(authority_.of("r2").holder, "token:local");
  EXPECT_TRUE(authority_.is_kept_by("r1", by("token:local", "script-two"))) << "it is free";

  ASSERT_TRUE(authority_.use("r1", by("session:1", "tab-one-")));
  ASSERT_TRUE(authority_.use("r1", by("session:1", "tab-two-"))) << "the other tab of one session commands";
  clock_.run_for(2s);
  authority_.keep_alive("r1", by("session:1", "tab-one-"));
  clock_.run_for(1s);
  EXPECT_EQ(authority_.of("r1").holder, "");
}

TEST_F(AuthorityTest, AnEventNamesThePageOrTheScript) {
  EXPECT_EQ((*authority_.use("r1", by("token:local", "1f2e3d4c5b6a")))->cause, "by token:local, script 1f2e3d4c");
  ASSERT_TRUE(authority_.request("r1", by("user:ana/session:4", "0123456789")));
  EXPECT_EQ(authority_.hand_over("r1", "token:local")->cause, "by token:local to user:ana/session:4, page 01234567");
  clock_.run_for(2s);
  authority_.keep_alive("r1", by("user:ana/session:4", "0123456789"));
  clock_.run_for(2s);
  EXPECT_EQ(authority_.of("r1").holder, "user:ana/session:4");
}

}  // namespace
}  // namespace server
