// A robot that is reserved: only its holder commands it, everybody may stop it, and what others had left waiting ends.
#include "tests/server/link/timed_fixture.hpp"

namespace server {
namespace {

class ReservedRobotTest : public TimedTest {
 protected:
  station::Reservation slot(const std::string& holder, microseconds in, microseconds lasts = 1h) const {
    station::Reservation made;
    made.id = 4;
    made.robot_id = "r1";
    made.holder = holder;
    made.from_us = clock.utc_us() + in.count();
    made.until_us = made.from_us + lasts.count();
    made.purpose = "bed 3";
    made.made_by = holder;
    return made;
  }
  void submit_as(const std::string& actor, protocol::Command action) {
    station::CommandRequest request = request_of(action);
    request.actor = actor;
    submit(std::move(request));
    clock.settle();
  }
  std::size_t events(const std::string& kind) const {
    return static_cast<std::size_t>(std::ranges::count(sink.events, kind, &station::RobotEvent::kind));
  }
};

TEST_F(ReservedRobotTest, OnlyItsHolderCommandsItAndEverybodyStopsIt) {
  station.add_reservation(slot("user:anna", 0s));
  EXPECT_EQ(events("reservation_made"), 1U);
  ASSERT_TRUE(station.find("r1")->reservation);
  EXPECT_EQ(station.find("r1")->reservation->holder, "user:anna");
  submit_as("user:ben/session:2", set_duty(0.1F));
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].error().reason, "reserved");
  EXPECT_TRUE(robot->commands().empty());
  EXPECT_EQ(station.find("r1")->control.holder, "");
  submit_as("user:anna/session:1", set_duty(0.1F));
  ASSERT_EQ(robot->commands().size(), 1U);
  EXPECT_EQ(station.find("r1")->control.holder, "user:anna/session:1");
  submit_as("user:ben/session:2", ping());
  EXPECT_EQ(robot->commands().size(), 2U) << "it commands nothing";
  stop_robot();  // by "test"
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 3U) << "SAFETY: no reservation keeps a stop from the robot";
  EXPECT_EQ(robot->commands()[2].which_action, rheonaut_Command_emergency_stop_tag);
}

TEST_F(ReservedRobotTest, WhenASlotBeginsWhatOthersLeftWaitingIsDroppedAndItIsInTheLog) {
  tasks.spawn("control", station.watch_control());
  control(station::ControlAction::take, "ben");
  station.add_reservation(slot("user:anna", 2s, 10s));
  EXPECT_FALSE(station.find("r1")->reservation) << "it does not run yet";
  admit(timed(set_setpoint(0.1F), in_ms(6000), "ben"));
  clock.run_for(1500ms);
  station.keep_control({"ben", ""}, "r1", 0us);
  EXPECT_EQ(drops(), 0U);
  EXPECT_EQ(station.find("r1")->control.holder, "ben");
  clock.run_for(1s);
  EXPECT_EQ(drops(), 1U) << "SAFETY: nothing of theirs acts in the slot";
  EXPECT_EQ(events("control_ended_by_reservation"), 1U);
  EXPECT_EQ(station.find("r1")->control.holder, "");
  EXPECT_TRUE(station.find("r1")->reservation);
  clock.run_for(10s);
  EXPECT_FALSE(station.find("r1")->reservation) << "it is over";
  submit_as("ben", set_duty(0.1F));
  EXPECT_EQ(std::string{protocol::kind(robot->commands().back())}, "set_duty");
}

TEST_F(ReservedRobotTest, WithoutNoticeOnlyAnAdministratorEndsSomebodysControl) {
  const microseconds notice = station::kReservationNotice;
  EXPECT_TRUE(station.check_reservation(slot("user:anna", 0s), false)) << "nobody is in control";
  control(station::ControlAction::take, "user:ben/session:2");
  const auto refused = station.check_reservation(slot("user:anna", notice - 1us), false);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, "not_in_control");
  EXPECT_NE(refused.error().detail.find("user:ben/session:2"), std::string::npos);
  EXPECT_TRUE(station.check_reservation(slot("user:anna", notice), false));
  EXPECT_TRUE(station.check_reservation(slot("user:anna", 0s), true));
  EXPECT_TRUE(station.check_reservation(slot("user:ben", 0s), false)) << "it is theirs";
}

TEST_F(ReservedRobotTest, WhatAReservationHasEndedStaysEndedWhenItIsCancelled) {
  control(station::ControlAction::take, "ben");
  station.add_reservation(slot("user:anna", 1s));
  clock.run_for(1s);  // nobody has looked since
  station.remove_reservation(4, "user:root");
  EXPECT_EQ(events("control_ended_by_reservation"), 1U);
  EXPECT_EQ(events("reservation_cancelled"), 1U);
  EXPECT_EQ(station.holder("r1"), "");
  EXPECT_FALSE(station.find("r1")->reservation);
  EXPECT_EQ(station.find_reservation(4), nullptr);
  control(station::ControlAction::take, "ben");
}

TEST_F(ReservedRobotTest, ReservationsOfAnEarlierStartHoldBeforeAnythingIsCommanded) {
  station.restore({}, {}, {slot("user:anna", 0s)});
  submit_as("token:ci", set_duty(0.1F));
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].error().reason, "reserved");
}

}  // namespace
}  // namespace server
