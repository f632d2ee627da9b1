// Timed commands that wait on the robot when its connection is replaced, or the station has restarted.
#include "tests/server/link/timed_fixture.hpp"

namespace server {
namespace {

class TimedConnectionTest : public TimedTest {
 protected:
  // The same boot over a second connection, while the station still holds the first one for good.
  void dial_again() {
    const std::int64_t booted_at_us = robot->booted_at_us;
    robot = dial();
    robot->booted_at_us = booted_at_us;
    robot->say_hello();
    ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
    robot->keep_talking();
    clock.settle();
  }
};

// The model finds it (DROP_AFTER_LINK): the drop was written into the connection that the robot had left.
TEST_F(TimedConnectionTest, AreDroppedOverTheConnectionThatReplacesTheOneOfTheDrop) {
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  control(station::ControlAction::force, "b");
  ASSERT_EQ(drops(), 1U);
  dial_again();
  const auto sent = kinds();
  const std::vector<std::string> names{sent.begin(), sent.end()};  // not addresses
  ASSERT_EQ(names, std::vector<std::string>{"drop_timed"}) << "ahead of whatever b commands";
}

TEST_F(TimedConnectionTest, WhatWasSentOverAReplacedConnectionHasNoAnswer) {
  const auto sent = send_out(request_of(set_duty(0.25F), 8s));
  dial_again();
  EXPECT_EQ(latest(sent.command_id).state, station::CommandState::unknown);
  EXPECT_EQ(latest(sent.command_id).reason, "link_lost");
}

class RestartedStationTest : public LinkTest {
 protected:
  std::size_t drops_after(station::BootId stored_boot) {
    station.restore({{"r1", stored_boot, 0}}, {});
    const auto commands = connect()->commands();
    return static_cast<std::size_t>(std::ranges::count_if(commands, [](const protocol::Command& command) {
      return command.which_action == rheonaut_Command_drop_timed_tag;
    }));
  }
};

// The model finds it (DROP_AFTER_RESTART): the next to command would renew the lease of what somebody else left.
TEST_F(RestartedStationTest, DropsWhatAnEarlierRunMayHaveLeftOnTheRobot) { EXPECT_EQ(drops_after(77), 1U); }

TEST_F(RestartedStationTest, DropsNothingOfABootThatItHasNotSeenBefore) { EXPECT_EQ(drops_after(76), 0U); }

}  // namespace
}  // namespace server
