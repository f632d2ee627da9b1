// A command on its way to the robot and back: sent, answered, expired, refused.
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

TEST_F(LinkTest, ACommandIsAcknowledgedWithTheTimeOfItsEffect) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 1u);
  const auto command = robot->commands()[0];
  EXPECT_EQ(command.boot_id, 77u);
  EXPECT_NE(command.command_id, 0u);
  EXPECT_LE(command.valid_until_robot_us, robot->robot_now_us() + 2'000'000);
  robot->acknowledge(command, rheonaut_COMMAND_RESULT_ACCEPTED);
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 100ms));
  EXPECT_EQ(results[0]->state, station::CommandState::acknowledged);
  EXPECT_EQ(results[0]->effect_at_robot_us, robot->robot_now_us());
  EXPECT_EQ(sink.commands.front().state, station::CommandState::queued);
  EXPECT_EQ(sink.commands.back().state, station::CommandState::acknowledged);
}

TEST_F(LinkTest, ARefusalOfTheRobotReachesTheCaller) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_WRONG_MODE);
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 100ms));
  EXPECT_EQ(results[0]->state, station::CommandState::rejected);
  EXPECT_EQ(results[0]->reason, "wrong_mode");
}

TEST_F(LinkTest, TheEndOfACommandWithoutAnswerIsUnknown) {
  connect();
  submit(set_duty(0.3F), 500ms);
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 3s));
  EXPECT_EQ(results[0]->state, station::CommandState::unknown);
  EXPECT_EQ(results[0]->reason, "no_answer");
}

// Whatever the robot says or does not say, and whatever is waited for.
TEST_F(LinkTest, ThatNoAnswerCameIsSaidWithin100MsOfTheEndOfItsLife) {
  for (const bool is_silent : {false, true}) {
    for (const bool until_verified : {false, true}) {
      results.clear();
      auto* robot = is_silent ? dial() : connect();
      if (is_silent) robot->say_hello();
      ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
      auto request = request_of(set_duty(0.3F), 500ms);
      request.until_verified = until_verified;
      const std::int64_t asked_at_us = clock.steady_us();
      submit(std::move(request));
      ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 3s));
      EXPECT_EQ(results[0]->state, station::CommandState::unknown);
      EXPECT_EQ(results[0]->reason, "no_answer");
      const std::int64_t after_us = clock.steady_us() - asked_at_us;
      EXPECT_GE(after_us, 500'000) << is_silent << until_verified;
      EXPECT_LE(after_us, 600'000) << is_silent << until_verified;
    }
  }
}

TEST_F(LinkTest, ACommandThatWaitedLongerThanItsLifeIsNeverSent) {
  auto* robot = dial(64);
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  robot->keep_talking();
  robot->link.stall(true);                              // the station's bytes pile up, and the robot's arrive late
  protocol::Command ping = rheonaut_Command_init_zero;  // of which none supersedes another
  ping.which_action = rheonaut_Command_ping_tag;
  for (int i = 0; i < 20; ++i) submit(ping, 300ms);
  clock.run_for(600ms);
  robot->link.stall(false);
  ASSERT_TRUE(clock.run_until([&] { return results.size() == 20; }, 3s));
  const std::size_t sent = robot->commands().size();
  EXPECT_LT(sent, 5u) << "what fitted into the link before it stalled";
  const auto count = [this](station::CommandState state) {
    return std::ranges::count_if(results, [state](const auto& result) { return result->state == state; });
  };
  EXPECT_EQ(static_cast<std::size_t>(count(station::CommandState::unknown)), sent);
  EXPECT_EQ(static_cast<std::size_t>(count(station::CommandState::expired)), 20 - sent);
}

TEST_F(LinkTest, RefusesWithoutSendingWhatIsOutsideTheEnvelope) {
  auto* robot = connect();
  submit(set_duty(1.5F));
  submit(set_duty(std::numeric_limits<float>::quiet_NaN()));
  submit(set_duty(0.1F), 11s);
  clock.settle();
  ASSERT_EQ(results.size(), 3u);
  for (const auto& result : results) EXPECT_EQ(result.error().code, ErrorCode::invalid);
  EXPECT_TRUE(robot->commands().empty());
}

TEST_F(LinkTest, AnUnknownAndADisconnectedRobotAreDistinguished) {
  submit(set_duty(0));
  clock.settle();
  EXPECT_EQ(results.at(0).error().code, ErrorCode::not_found);
  station.restore({{"r1", 0, 0}}, {});
  submit(set_duty(0));
  clock.settle();
  EXPECT_EQ(results.at(1).error().code, ErrorCode::not_connected);
}

TEST_F(LinkTest, TheEndOfWhatWasSentIsUnknownWhenTheLinkIsLost) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  robot->link.cut();
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 100ms));
  EXPECT_EQ(results[0]->state, station::CommandState::unknown);
  EXPECT_EQ(results[0]->reason, "link_lost");
}

}  // namespace
}  // namespace server
