// What waits is taken back when control ends, limits narrow or a step is lost.
#include "server/station/timed_commands.hpp"

#include <gmock/gmock.h>

#include "tests/server/station/entry_fixture.hpp"

namespace server {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

class TimedCommandsTest : public EntryTest {
 protected:
  std::shared_ptr<station::PendingCommand> add_timed() {
    protocol::Command command = set_duty(0.3F);
    command.has_execute_at_robot_us = true;
    command.execute_at_robot_us = 1'500'000;
    entry.timed.by = {"session:1", "tab-one-"};
    entry.timed.until_robot_us = command.execute_at_robot_us;
    return add(command);
  }

  station::SinkNotifier notifier{clock};
  station::CommandTracker tracker{loop, clock, notifier};
  station::TimedCommands timed{loop, clock, notifier, tracker};
};

TEST_F(TimedCommandsTest, NothingIsDroppedWhileItsSenderIsInControl) {
  add_timed();
  const station::Client sender{"session:1", "tab-one-"};
  EXPECT_TRUE(timed.drop_outdated(entry, sender));
  EXPECT_THAT(link.sent, IsEmpty());
}

TEST_F(TimedCommandsTest, WhenControlEndsTheRobotIsSentOneDropOfWhatWaits) {
  const auto waiting = add_timed();
  tracker.on_sent(entry, waiting->record.id);
  EXPECT_TRUE(timed.drop_outdated(entry, {}));
  ASSERT_THAT(link.sent, SizeIs(1));
  EXPECT_EQ(link.sent[0].which_action, rheonaut_Command_drop_timed_tag);
  EXPECT_STREQ(waiting->expiry(), "control_ended");
  EXPECT_TRUE(timed.drop_outdated(entry, {}));
  EXPECT_THAT(link.sent, SizeIs(1)) << "it is on its way";
  entry.commands.take_unanswered(entry.timed.drop_id);
  EXPECT_TRUE(timed.drop_outdated(entry, {}));
  EXPECT_THAT(link.sent, SizeIs(2)) << "it ended without an acknowledgement";
}

TEST_F(TimedCommandsTest, WithoutRoomOnTheLinkNoCommandMayFollow) {
  add_timed();
  link.is_full = true;
  EXPECT_FALSE(timed.drop_outdated(entry, {}));
  link.is_full = false;
  EXPECT_TRUE(timed.drop_outdated(entry, {}));
}

TEST_F(TimedCommandsTest, WhatIsQueuedIsWithdrawnUnlessItEndsAMotion) {
  const auto forward = add(set_duty(0.3F)), halt = add(set_duty(0));
  link.can_withdraw = {forward->record.id, halt->record.id};
  timed.withdraw_queued(entry, "limits_changed", [](const station::PendingCommand&) { return true; });
  EXPECT_EQ(forward->record.state, station::CommandState::superseded);
  EXPECT_EQ(forward->record.reason, "limits_changed");
  EXPECT_EQ(halt->record.state, station::CommandState::queued);
}

}  // namespace
}  // namespace server
