// The commands of a robot, by what they wait for.
#include "server/station/commands/robot_commands.hpp"

#include <gmock/gmock.h>

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::UnorderedElementsAre;

class RobotCommandsTest : public ::testing::Test {
 protected:
  std::shared_ptr<station::PendingCommand> make(station::CommandId id,
                                                pb_size_t which_action = rheonaut_Command_set_duty_tag) {
    auto pending = std::make_shared<station::PendingCommand>(loop);
    pending->record.id = id;
    pending->wire.command_id = id;
    pending->wire.which_action = which_action;
    return pending;
  }
  std::shared_ptr<station::PendingCommand> add(station::CommandId id,
                                               pb_size_t which_action = rheonaut_Command_set_duty_tag) {
    auto pending = make(id, which_action);
    commands.add(pending);
    return pending;
  }

  boost::asio::io_context loop;
  station::RobotCommands commands;
};

TEST_F(RobotCommandsTest, AreNumberedInTheOrderOfSubmission) {
  EXPECT_TRUE(commands.is_empty());
  const auto first = add(9), second = add(5);
  EXPECT_LT(first->number, second->number);
  EXPECT_FALSE(commands.is_empty());
  EXPECT_EQ(commands.find_unanswered(9), first);
  EXPECT_EQ(commands.take_unanswered(9), first);
  EXPECT_EQ(commands.find_unanswered(9), nullptr);
  EXPECT_EQ(commands.take_unanswered(9), nullptr);
}

TEST_F(RobotCommandsTest, OnlyThoseThatAreNoStopAndHaveNotLeftAreQueued) {
  add(1);
  add(2)->record.state = station::CommandState::sent;
  add(3, rheonaut_Command_emergency_stop_tag);
  add(4, rheonaut_Command_set_setpoint_tag);
  EXPECT_THAT(commands.queued(), UnorderedElementsAre(1U, 4U));
}

// SAFETY's test: the newest is the one that was asked for last, whatever its random id.
TEST_F(RobotCommandsTest, TheNewestStopIsTheLastThatWasAdded) {
  EXPECT_EQ(commands.newest_stop(), nullptr);
  add(8, rheonaut_Command_emergency_stop_tag);
  const auto newest = add(2, rheonaut_Command_emergency_stop_tag);
  add(5);
  EXPECT_EQ(commands.newest_stop(), newest);
  EXPECT_EQ(commands.stops(), 2U);
  commands.take_unanswered(2);
  EXPECT_EQ(commands.newest_stop()->record.id, 8U);
}

TEST_F(RobotCommandsTest, IsOnItsWayUntilNothingWaitsForItAnyMore) {
  const auto unanswered = add(1);
  const auto unseen = make(2), unread = make(3), unknown = make(4);
  commands.unseen.push_back(unseen);
  commands.unread.push_back(unread);
  commands.keep_unknown(unknown);
  EXPECT_EQ(commands.on_its_way(1), unanswered);
  EXPECT_EQ(commands.on_its_way(2), unseen);
  EXPECT_EQ(commands.on_its_way(3), unread);
  EXPECT_EQ(commands.on_its_way(4), nullptr) << "it has ended";
}

TEST_F(RobotCommandsTest, OneWithAnUnknownEndWaitsForItsAnswerAgain) {
  const auto unknown = make(4);
  unknown->record.state = station::CommandState::unknown;
  unknown->record.ended_at_us = 77;
  commands.keep_unknown(unknown);
  EXPECT_TRUE(commands.is_empty());
  EXPECT_EQ(commands.reopen(5), nullptr);
  EXPECT_EQ(commands.reopen(4), unknown);
  EXPECT_EQ(unknown->record.state, station::CommandState::sent);
  EXPECT_EQ(unknown->record.ended_at_us, 0);
  EXPECT_EQ(commands.find_unanswered(4), unknown);
  EXPECT_EQ(commands.reopen(4), nullptr);
}

TEST_F(RobotCommandsTest, OfManyWithAnUnknownEndTheOldestLeave) {
  for (station::CommandId id = 1; id <= station::RobotCommands::kMaxWaiting + 1; ++id) commands.keep_unknown(make(id));
  EXPECT_EQ(commands.unknown.size(), station::RobotCommands::kMaxWaiting);
  EXPECT_EQ(commands.reopen(1), nullptr);
  EXPECT_NE(commands.reopen(2), nullptr);
}

TEST_F(RobotCommandsTest, WhatIsReadBackIsListedInTheOrderOfSubmissionOnceItHasLeft) {
  const auto sent = add(9, rheonaut_Command_set_parameter_tag);
  add(1, rheonaut_Command_set_parameter_tag);          // queued
  add(2)->record.state = station::CommandState::sent;  // telemetry shows it
  const auto acknowledged = add(3, rheonaut_Command_set_parameter_tag);
  commands.unread.push_back(commands.take_unanswered(3));
  EXPECT_THAT(commands.to_be_read_back(), ElementsAre(acknowledged));
  sent->record.state = station::CommandState::sent;
  EXPECT_THAT(commands.to_be_read_back(), ElementsAre(sent, acknowledged));
}

}  // namespace
}  // namespace server
