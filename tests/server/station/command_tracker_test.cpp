// Commands from their submission to their end, without a station around them.
#include "server/station/command_tracker.hpp"

#include <gmock/gmock.h>

#include "tests/server/station/entry_fixture.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class CommandTrackerTest : public EntryTest {
 protected:
  CommandTrackerTest() { notifier.add(sink); }

  static protocol::CommandAck answer(const station::PendingCommand& pending, protocol::CommandResult result) {
    protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
    ack.command_id = pending.record.id;
    ack.result = result;
    ack.effect_at_robot_us = 1'050'000;
    return ack;
  }
  void answered(station::PendingCommand& pending, protocol::CommandResult result) {
    const auto ack = answer(pending, result);
    const auto found = tracker.find_answered(entry, ack);
    ASSERT_NE(found, nullptr);
    tracker.on_answer(entry, *found, ack);
  }
  static station::SampleBatch batch_with_duty(float duty) {
    station::SampleBatch batch;
    batch.first_robot_time_us = 1'060'000;
    batch.context.period_us = 10'000;
    batch.context.mode = rheonaut_MODE_MANUAL;
    batch.samples.resize(2);
    for (station::Sample& sample : batch.samples) sample.duty = duty;
    return batch;
  }

  station::SinkNotifier notifier{clock};
  KeepingSink sink;
  station::CommandTracker tracker{loop, clock, notifier};
};

TEST_F(CommandTrackerTest, SentThenAcknowledgedThenSeenInTelemetry) {
  const auto duty = add(set_duty(0.3F));
  tracker.on_sent(entry, duty->record.id);
  answered(*duty, rheonaut_COMMAND_RESULT_ACCEPTED);
  tracker.on_samples(entry, batch_with_duty(0.3F));
  EXPECT_THAT(sink.states, ElementsAre(station::CommandState::sent, station::CommandState::acknowledged,
                                       station::CommandState::verified));
  EXPECT_TRUE(entry.commands.is_empty());
}

TEST_F(CommandTrackerTest, RecordsOfAStopAreHeldBackUntilItsSenderPublishesThem) {
  const auto duty = add(set_duty(0.3F));
  std::vector<station::CommandRecord> held_back;
  entry.commands.sent_with_stop = &held_back;
  tracker.on_sent(entry, duty->record.id);
  EXPECT_THAT(sink.states, IsEmpty());
  ASSERT_EQ(held_back.size(), 1u);
  EXPECT_EQ(held_back[0].state, station::CommandState::sent);
}

TEST_F(CommandTrackerTest, WhatIsNotSentInTimeExpiresAndWhatGetsNoAnswerIsUnknown) {
  const auto queued = add(set_duty(0.3F)), sent = add(set_duty(0.2F));
  tracker.on_sent(entry, sent->record.id);
  clock.run_for(std::chrono::milliseconds{2'040});  // their time to live is 2 s
  tracker.expire(entry);
  EXPECT_EQ(queued->record.state, station::CommandState::expired);
  EXPECT_EQ(queued->record.reason, "not_sent_in_time");
  EXPECT_EQ(sent->record.state, station::CommandState::sent) << "its answer may be on its way";
  clock.run_for(std::chrono::milliseconds{10});
  tracker.expire(entry);
  EXPECT_EQ(sent->record.state, station::CommandState::unknown);
  answered(*sent, rheonaut_COMMAND_RESULT_REJECTED);
  EXPECT_EQ(sent->record.state, station::CommandState::rejected) << "an answer that comes after all";
}

TEST_F(CommandTrackerTest, WhenTheLinkIsLostOnlyStopsStay) {
  protocol::Command stop = rheonaut_Command_init_zero;
  stop.which_action = rheonaut_Command_emergency_stop_tag;
  const auto kept = add(stop), queued = add(set_duty(0.3F));
  tracker.end_with_link(entry, "link_lost");
  EXPECT_EQ(queued->record.state, station::CommandState::failed);
  EXPECT_EQ(kept->record.state, station::CommandState::queued);
  EXPECT_NE(entry.commands.newest_stop(), nullptr);
}

TEST_F(CommandTrackerTest, AnEventThatNamesACommandStandsForItsLostAnswer) {
  const auto duty = add(set_duty(0.3F));
  tracker.on_sent(entry, duty->record.id);
  protocol::Event event = rheonaut_Event_init_zero;
  event.command_id = duty->record.id;
  event.event_robot_time_us = 1'040'000;
  tracker.on_event(entry, event);
  EXPECT_EQ(duty->record.state, station::CommandState::acknowledged);
  EXPECT_EQ(duty->record.reason, "named_by_event");
}

// SAFETY: a duty of 0 cancels the timed commands in the robot; the duty that follows it does not.
TEST_F(CommandTrackerTest, ADutyOfZeroThatIsQueuedIsSentThoughAnotherDutyFollows) {
  const auto first = add(set_duty(0.3F)), halt = add(set_duty(0));
  link.can_withdraw = {first->record.id, halt->record.id};
  const auto next = add(set_duty(0.1F));
  tracker.supersede_queued(entry, *next);
  EXPECT_EQ(first->record.state, station::CommandState::superseded);
  EXPECT_EQ(halt->record.state, station::CommandState::queued);
  tracker.supersede_queued(entry, *add(set_duty(0)));
  EXPECT_EQ(halt->record.state, station::CommandState::superseded) << "by one that does the same";
}

TEST_F(CommandTrackerTest, AKeyThatWasUsedForAnotherCommandIsRefused) {
  station::CommandRequest request;
  request.robot_id = robot.id;
  request.actor = "session:1";
  request.key = "try-1";
  request.action = set_duty(0.3F);
  const auto pending = make_pending(loop, clock, request, robot);
  entry.commands.add(pending);
  EXPECT_EQ(tracker.find_same(request, entry).value(), pending);
  request.arguments = R"({"duty":0.4})";
  EXPECT_EQ(tracker.find_same(request, entry).error().reason, "key_reused");
  request.key = "try-2";
  EXPECT_EQ(tracker.find_same(request, entry).value(), nullptr);
}

}  // namespace
}  // namespace server
