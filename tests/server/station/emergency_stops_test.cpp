// Stops alone: the frame is handed over, what is to be published is returned, and nothing else is touched.
#include "server/station/emergency_stops.hpp"

#include <gmock/gmock.h>

#include "tests/server/station/entry_fixture.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class EmergencyStopsTest : public EntryTest {
 protected:
  std::shared_ptr<station::PendingCommand> begin(const std::string& key = "") {
    station::StopRequest request;
    request.actor = "user:anna";
    request.key = key;
    return stops.begin(entry, request, records);
  }
  std::shared_ptr<station::PendingCommand> add_with_key(const protocol::Command& command, const std::string& key) {
    station::CommandRequest request;
    request.robot_id = robot.id;
    request.action = command;
    request.actor = "user:anna";
    request.key = key;
    auto pending = make_pending(loop, clock, request, robot);
    entry.commands.add(pending);
    return pending;
  }
  static protocol::CommandAck obeyed() {
    protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
    ack.result = rheonaut_COMMAND_RESULT_ACCEPTED;
    ack.effect_at_robot_us = 1'100'000;
    ack.emergency_id = 9;
    return ack;
  }

  station::RecentCommands recent;
  station::EmergencyStops stops{loop, clock, recent};
  std::vector<station::CommandRecord> records;
};

TEST_F(EmergencyStopsTest, TheFrameIsHandedOverAndItsRecordReturned) {
  const auto stop = begin();
  EXPECT_THAT(link.stops, ElementsAre(stop->record.id));
  ASSERT_THAT(records, SizeIs(1));
  EXPECT_EQ(records[0].id, stop->record.id);
  EXPECT_EQ(records[0].state, station::CommandState::queued);
  EXPECT_EQ(robot.pending_stop, stop->record.id);
  EXPECT_EQ(entry.commands.sent_with_stop, nullptr) << "what the link sends later is published at once";
}

TEST_F(EmergencyStopsTest, WhatWasQueuedIsSuperseded) {
  const auto duty = add(set_duty(0.3F));
  begin();
  EXPECT_EQ(duty->record.state, station::CommandState::superseded);
  EXPECT_EQ(duty->record.reason, "by_emergency_stop");
  EXPECT_THAT(records, SizeIs(2));
  EXPECT_EQ(entry.commands.find_unanswered(duty->record.id), nullptr);
}

TEST_F(EmergencyStopsTest, OnePressThatComesTwiceIsOneStop) {
  const auto first = begin("press-1");
  records.clear();
  EXPECT_EQ(begin("press-1"), first);
  EXPECT_THAT(records, IsEmpty());
  EXPECT_THAT(link.stops, SizeIs(1));
  EXPECT_NE(begin("press-2"), first);
  EXPECT_THAT(link.stops, SizeIs(2));
}

// SAFETY: the answer of another command is none to a stop.
TEST_F(EmergencyStopsTest, TheKeyOfACommandThatWaitsForItsAnswerStopsAllTheSame) {
  const auto ahead = add_with_key(set_duty(0.3F), "press-1");
  const auto stop = begin("press-1");
  EXPECT_NE(stop, ahead);
  EXPECT_NE(stop->record.id, ahead->record.id);
  EXPECT_THAT(link.stops, ElementsAre(stop->record.id));
  EXPECT_EQ(entry.commands.newest_stop(), stop) << "it is kept until the robot has obeyed";
}

TEST_F(EmergencyStopsTest, TheKeyOfAnAnsweredCommandStopsALatchedRobotAgain) {
  const auto ended = add_with_key(set_duty(0.3F), "press-1");
  entry.commands.take_unanswered(ended->record.id);
  end_command(*ended, station::CommandState::verified, "", clock, recent);
  ASSERT_NE(recent.find(ended->record.id), nullptr);
  robot.context.emergency_id = 9;
  const auto stop = begin("press-1");
  EXPECT_EQ(stop->record.kind, "emergency_stop");
  EXPECT_THAT(link.stops, ElementsAre(stop->record.id));
}

TEST_F(EmergencyStopsTest, AStopThatTheLinkThrowsAwayIsKeptAndRepeatedEachSecond) {
  link.is_broken = true;
  EXPECT_THROW(begin(), std::runtime_error);
  EXPECT_EQ(entry.commands.sent_with_stop, nullptr);
  link.is_broken = false;
  stops.repeat(entry, records);
  EXPECT_THAT(link.stops, IsEmpty());
  clock.run_for(std::chrono::seconds{1});
  stops.repeat(entry, records);
  EXPECT_THAT(link.stops, SizeIs(1));
}

TEST_F(EmergencyStopsTest, WithoutALinkItWaitsAndGoesFirstWhenTheRobotIsBack) {
  entry.link = nullptr;
  const auto stop = begin();
  EXPECT_EQ(begin(), stop) << "one stop is enough for a robot that is away";
  entry.link = &link;
  stops.on_connected(entry, false, records);
  EXPECT_THAT(link.stops, ElementsAre(stop->record.id));
}

TEST_F(EmergencyStopsTest, ARobotThatLostItsLatchIsLatchedAgain) {
  stops.on_connected(entry, false, records);
  EXPECT_THAT(link.stops, IsEmpty());
  stops.on_connected(entry, true, records);
  EXPECT_THAT(link.stops, SizeIs(1));
  ASSERT_THAT(records, SizeIs(1));
  EXPECT_EQ(records[0].actor, "station:latch");
}

TEST_F(EmergencyStopsTest, AnAnswerSettlesThisStopAndTheEarlierOnes) {
  const auto first = begin("1"), second = begin("2"), third = begin("3");
  EXPECT_THAT(stops.on_answer(entry, *second, obeyed()), SizeIs(2));
  EXPECT_EQ(robot.context.emergency_id, 9u);
  auto unlatched = obeyed();
  unlatched.emergency_id = 0;
  EXPECT_THAT(stops.on_answer(entry, *third, unlatched), IsEmpty()) << "it has not obeyed";
  entry.commands.take_unanswered(first->record.id);
  entry.commands.take_unanswered(second->record.id);
  station::EmergencyStops::show_pending(entry);
  EXPECT_EQ(robot.pending_stop, third->record.id);
}

TEST_F(EmergencyStopsTest, OnlyARetiredRobotThatHasBeenAwayForLongIsLeftOut) {
  clock.run_for(std::chrono::seconds{61});
  EXPECT_FALSE(stops.may_be_left_out(entry));
  robot.retired_at_us = 1;
  EXPECT_FALSE(stops.may_be_left_out(entry)) << "it is connected";
  entry.link = nullptr;
  EXPECT_TRUE(stops.may_be_left_out(entry));
  robot.last_received_steady_us = clock.steady_us();
  EXPECT_FALSE(stops.may_be_left_out(entry)) << "it may still move";
}

}  // namespace
}  // namespace server
