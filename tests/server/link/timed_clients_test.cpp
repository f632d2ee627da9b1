// Commands that wait on the robot for their time are of one client: a page, or an invocation of a program.
#include "tests/server/link/timed_fixture.hpp"

namespace server {
namespace {

using TimedClientsTest = TimedTest;

// SAFETY: a script that has ended moves nothing under the signs of life of another one with the same token.
TEST_F(TimedClientsTest, IsDroppedAheadOfTheFirstCommandOfAnotherClientOfItsActor) {
  const auto of_client = [&](station::CommandRequest request, const char* client) {
    request.client = client;
    return request;
  };
  admit(of_client(timed(set_duty(0.25F), in_ms(7000), "a"), "script-one"));
  admit(of_client(timed(set_duty(0.25F), in_ms(7100), "a"), "script-one"));
  EXPECT_EQ(drops(), 0U);
  station::CommandRequest next = request_of(set_duty(0.5F));
  next.actor = "a";
  submit(of_client(std::move(next), "script-two"));
  clock.settle();
  const auto commands = robot->commands();
  ASSERT_GE(commands.size(), 2U);
  EXPECT_EQ(commands[commands.size() - 2].which_action, rheonaut_Command_drop_timed_tag);
  EXPECT_EQ(commands.back().which_action, rheonaut_Command_set_duty_tag);
}

TEST_F(TimedClientsTest, IsDroppedWhenAnotherClientOfItsActorTakesControl) {
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  station::ControlRequest take;
  take.robot_id = "r1";
  take.actor = "a";
  take.client = "script-two";
  ASSERT_TRUE(station.control(take));
  clock.settle();
  EXPECT_EQ(drops(), 1U);
}

}  // namespace
}  // namespace server
