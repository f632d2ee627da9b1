// What a robot is still to do, put together from what it has accepted and what is on its way.
#include "server/station/commands/order_timeline.hpp"

#include <gmock/gmock.h>

#include "tests/server/station/entry_fixture.hpp"

namespace server {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

class OrderTimelineTest : public EntryTest {
 protected:
  std::shared_ptr<station::PendingCommand> accept_schedule() {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_schedule_tag;
    auto& schedule = command.action.set_duty_schedule;
    schedule.duty_count = schedule.tick_count = 2;
    schedule.duty[0] = 0.5F;
    schedule.tick[1] = 20;  // 200 ms
    const auto pending = add(command);
    entry.commands.take_unanswered(pending->record.id);
    pending->record.effect_at_robot_us = pending->look_from_robot_us = 1'000'000;
    timeline.note_accepted(pending, robot.sample_period_us);
    return pending;
  }
  station::OrdersAhead ahead() const { return timeline.ahead(robot, entry.commands); }

  station::OrderTimeline timeline;
};

TEST_F(OrderTimelineTest, AScheduleCountsUntilSamplesHaveShownItsEnd) {
  accept_schedule();
  ASSERT_THAT(ahead(), SizeIs(1));
  EXPECT_EQ(ahead()[0].until_robot_us, 1'200'000u);
  timeline.note_samples(1'100'000);
  EXPECT_EQ(ahead()[0].sampled_us, 100'000u);
  timeline.note_samples(1'200'000);
  EXPECT_THAT(ahead(), IsEmpty());
}

TEST_F(OrderTimelineTest, AnEventOfTheModeEndsTheSchedulesThatHaveBegun) {
  accept_schedule();
  protocol::Event event = rheonaut_Event_init_zero;
  event.kind = rheonaut_EVENT_KIND_LINK_LOST;
  event.event_robot_time_us = 1'000'000;
  timeline.note_event(event);
  EXPECT_THAT(ahead(), SizeIs(1)) << "it begins at that time";
  event.event_robot_time_us = 1'000'001;
  timeline.note_event(event);
  EXPECT_THAT(ahead(), IsEmpty());
}

TEST_F(OrderTimelineTest, AScheduleThatTheRobotRefusesAfterAllIsDropped) {
  const auto schedule = accept_schedule();
  timeline.drop_schedule(schedule->record.id + 1);
  EXPECT_THAT(ahead(), SizeIs(1));
  timeline.drop_schedule(schedule->record.id);
  EXPECT_THAT(ahead(), IsEmpty());
}

TEST_F(OrderTimelineTest, WhatANewerCommandTakesBackDoesNotCount) {
  add(set_duty(0.3F));
  const protocol::Command newer = set_duty(0.2F);
  EXPECT_THAT(ahead(), SizeIs(1));
  EXPECT_THAT(timeline.ahead(robot, entry.commands, &newer), IsEmpty());
}

}  // namespace
}  // namespace server
