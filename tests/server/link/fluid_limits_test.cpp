// What another fluid's limits end: motions, orders on their way, and what waits on the robot.
#include "server/link/robot_outbox.hpp"
#include "tests/server/link/limits_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class FluidLimitsTest : public TimedLimitsTest {};

TEST_F(FluidLimitsTest, ItIsDroppedWhenTheLimitsOfTheFluidBecomeNarrower) {
  const auto sent = admit(timed(set_duty(0.8F), in_ms(5000), "a"));
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(drops(), 1U);
  robot->acknowledge(sent, rheonaut_COMMAND_RESULT_EXPIRED);
  accept_last();
  EXPECT_EQ(latest(sent.command_id).state, station::CommandState::expired);
  EXPECT_EQ(latest(sent.command_id).reason, "limits_changed");

  admit(timed(set_duty(0.5F), in_ms(3000), "a"));
  ASSERT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(drops(), 1U) << "the limits have become wider";
  ASSERT_TRUE(station.set_fluid("r1", "", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(drops(), 1U) << "the strictest would accept it";
}

// SAFETY: a motion does not outlive the limits that allowed it.
TEST_F(FluidLimitsTest, AMotionBeyondTheLimitsOfAnotherFluidEnds) {
  show_setpoint(0.25F);
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  clock.settle();
  EXPECT_TRUE(robot->commands().empty()) << "0.25 m is within those of water";
  ASSERT_TRUE(station.set_fluid("r1", "honey", {"a", "", 0}));
  clock.settle();
  ASSERT_FALSE(robot->commands().empty());
  EXPECT_EQ(robot->commands().back().action.set_mode.mode, rheonaut_MODE_MANUAL);
  EXPECT_EQ(latest_of_kind("set_mode").actor, "station:limits");
}

// SAFETY: nor does an order that is on its way, or that the robot has taken and no telemetry shows yet.
TEST_F(FluidLimitsTest, AnOrderOnItsWayBeyondTheLimitsOfAnotherFluidEndsBehindIt) {
  for (const bool is_acknowledged : {false, true}) {
    ASSERT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
    clock.run_for(20ms);  // a sample of the same time does not show what was taken then
    show_setpoint(0);
    clock.run_for(20ms);
    EXPECT_EQ(refusal(now(set_setpoint(0.05F))), "");
    ASSERT_TRUE(station.set_fluid("r1", "honey", {"a", "", 0}));
    clock.settle();
    EXPECT_STREQ(kinds().back(), "set_setpoint") << "0.05 m is within those of honey";
    ASSERT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
    EXPECT_EQ(refusal(now(set_setpoint(0.25F))), "");
    if (is_acknowledged) accept_last();
    ASSERT_TRUE(station.set_fluid("r1", "honey", {"a", "", 0}));
    clock.settle();
    EXPECT_EQ(robot->commands().back().action.set_mode.mode, rheonaut_MODE_MANUAL) << is_acknowledged;
    EXPECT_STREQ(kinds().back(), "set_mode") << is_acknowledged;
    answer_all();
  }
}

TEST_F(FluidLimitsTest, WhereItsEndCannotBeSentTheFluidStays) {
  show_setpoint(0.25F);
  while (refusal(now(ping(), 9s)).empty()) {
  }
  const auto named = station.set_fluid("r1", "honey", {"a", "", 0});
  ASSERT_FALSE(named);
  EXPECT_EQ(named.error().reason, "queue_full");
  EXPECT_EQ(station.find("r1")->fluid, "non_newtonian");
}

TEST_F(FluidLimitsTest, WhatTheLinkHasNotTakenIsNotSentWhenTheLimitsBecomeNarrower) {
  fill_window();
  submit(now(set_duty(0.8F), 9s));
  clock.settle();
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(latest_of_kind("set_duty").state, station::CommandState::superseded);
  EXPECT_EQ(latest_of_kind("set_duty").reason, "limits_changed");
  submit(now(set_duty(0.5F), 9s));
  ASSERT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
  answer_all();
  EXPECT_EQ(robot->commands().back().action.set_duty.duty, 0.5F) << "the limits have become wider";
}

TEST_F(FluidLimitsTest, ItIsDroppedLaterWhenTheLinkWasFullAndNothingIsRenewedBefore) {
  admit(timed(set_duty(0.8F), in_ms(7000), "a"));
  for (std::size_t i = 0; i < link::CommandWindow::kMost + link::RobotOutbox::kMaxQueuedCommands; ++i) {
    submit(ping(), 5s);
    clock.settle();
  }
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  protocol::Command renewal = rheonaut_Command_init_zero;
  renewal.which_action = rheonaut_Command_renew_lease_tag;
  EXPECT_THAT(refusal(now(renewal)), HasSubstr("queue_full"));
  for (std::size_t i = 1; i < robot->commands().size(); ++i) {
    robot->acknowledge(robot->commands()[i], rheonaut_COMMAND_RESULT_ACCEPTED);
    clock.settle();
    if (i == 5) submit(now(renewal));
  }
  const auto sent = kinds();
  const auto drop = std::ranges::find(sent, std::string{"drop_timed"});
  const auto renewed = std::ranges::find(sent, std::string{"renew_lease"});
  ASSERT_NE(renewed, sent.end());
  EXPECT_LT(drop - sent.begin(), renewed - sent.begin());
  EXPECT_EQ(drops(), 1U);
}

}  // namespace
}  // namespace server
