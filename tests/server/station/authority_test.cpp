// Control of a robot: one at a time, ended by silence, handed over, forced.
#include "server/station/commands/authority.hpp"

#include <gtest/gtest.h>

#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;

class AuthorityTest : public ::testing::Test {
 protected:
  boost::asio::io_context loop_;
  VirtualClock clock_{loop_};
  station::Authority authority_{clock_};
};

TEST_F(AuthorityTest, WhoCommandsFirstIsInControlAndAnotherIsRefusedByName) {
  const auto first = authority_.use("r1", "session:1");
  ASSERT_TRUE(first && *first);
  EXPECT_EQ((*first)->kind, "control_taken");
  EXPECT_FALSE(*authority_.use("r1", "session:1")) << "nothing new";
  const auto second = authority_.use("r1", "session:2");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().reason, "not_in_control");
  EXPECT_NE(second.error().detail.find("session:1"), std::string::npos);
  EXPECT_TRUE(authority_.use("r2", "session:2")) << "another robot";
  EXPECT_FALSE(authority_.take("r1", "session:2", station::kControlLease));
  EXPECT_EQ(authority_.of("r1").holder, "session:1");
}

TEST_F(AuthorityTest, EndsWithSilenceAndIsReportedOnce) {
  ASSERT_TRUE(authority_.use("r1", "session:1"));
  clock_.run_for(station::kControlLease - 1us);
  EXPECT_FALSE(authority_.use("r1", "session:2"));
  EXPECT_TRUE(authority_.expire().empty());
  clock_.run_for(1us);
  EXPECT_EQ(authority_.of("r1").holder, "");
  const auto changes = authority_.expire();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].kind, "control_expired");
  EXPECT_TRUE(authority_.expire().empty());
  EXPECT_TRUE(authority_.use("r1", "session:2"));
}

TEST_F(AuthorityTest, ASignOfLifeKeepsWhatHasNotEnded) {
  ASSERT_TRUE(authority_.use("r1", "session:1"));
  for (int i = 0; i < 10; ++i) {
    clock_.run_for(2s);
    authority_.keep_alive("session:1");
    authority_.keep_alive("session:2");
  }
  EXPECT_EQ(authority_.of("r1").holder, "session:1");
  clock_.run_for(station::kControlLease);
  authority_.keep_alive("session:1");  // SAFETY: too late; what has ended stays ended
  EXPECT_EQ(authority_.of("r1").holder, "");
}

TEST_F(AuthorityTest, AScriptMaySayHowLongItTakes) {
  ASSERT_TRUE(authority_.take("r1", "token:local", 60s));
  clock_.run_for(59s);
  EXPECT_FALSE(authority_.use("r1", "session:1"));
  ASSERT_TRUE(authority_.use("r1", "token:local")) << "a command shortens nothing";
  clock_.run_for(1s);
  EXPECT_FALSE(authority_.use("r1", "session:1")) << "and lasts 3 s at least";
  clock_.run_for(2s);
  EXPECT_TRUE(authority_.use("r1", "session:1"));
}

TEST_F(AuthorityTest, IsReleasedByItsHolderOnly) {
  EXPECT_EQ(authority_.release("r1", "session:1").error().reason, "not_in_control");
  ASSERT_TRUE(authority_.use("r1", "session:1"));
  EXPECT_FALSE(authority_.release("r1", "session:2"));
  EXPECT_TRUE(authority_.release("r1", "session:1"));
  EXPECT_TRUE(authority_.use("r1", "session:2"));
}

TEST_F(AuthorityTest, IsHandedOverToWhoHasAsked) {
  EXPECT_EQ(authority_.request("r1", "session:2").error().reason, "control_is_free");
  ASSERT_TRUE(authority_.use("r1", "session:1"));
  EXPECT_EQ(authority_.hand_over("r1", "session:1").error().reason, "not_requested");
  ASSERT_TRUE(authority_.request("r1", "session:2"));
  EXPECT_EQ(authority_.of("r1").requested_by, "session:2");
  EXPECT_FALSE(authority_.hand_over("r1", "session:2")) << "who asks does not decide";
  ASSERT_TRUE(authority_.hand_over("r1", "session:1"));
  EXPECT_EQ(authority_.of("r1").holder, "session:2");
  EXPECT_EQ(authority_.of("r1").requested_by, "");
}

TEST_F(AuthorityTest, ARequestIsForgottenAfterAWhile) {
  ASSERT_TRUE(authority_.take("r1", "session:1", 300s));
  ASSERT_TRUE(authority_.request("r1", "session:2"));
  clock_.run_for(station::kRequestTimeout);
  EXPECT_EQ(authority_.of("r1").requested_by, "");
  EXPECT_FALSE(authority_.hand_over("r1", "session:1"));
}

TEST_F(AuthorityTest, ForceTakesItWithAReason) {
  ASSERT_TRUE(authority_.take("r1", "session:1", 300s));
  const auto change = authority_.take_by_force("r1", "session:2", "the operator has left");
  EXPECT_EQ(change.kind, "control_forced");
  EXPECT_EQ(change.cause, "by session:2 from session:1: the operator has left");
  EXPECT_FALSE(authority_.use("r1", "session:1"));
}

}  // namespace
}  // namespace server
