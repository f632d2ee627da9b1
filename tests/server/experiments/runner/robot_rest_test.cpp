// A robot is brought to rest though its answers come late, and is stopped when none comes.
#include "server/experiments/runner/robot_rest.hpp"

#include <deque>
#include <optional>

#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

using experiments::Rest;

class RobotRestTest : public LinkTest {
 protected:
  // Ends in `rest`. The robot obeys each command when it comes, and its answer takes so long; none: it never comes.
  void bring_to_rest(std::optional<microseconds> answers_after) {
    auto* robot = connect();
    tasks.spawn("bring to rest", run());
    tasks.spawn("robot", obey(*robot, answers_after));
    ASSERT_TRUE(clock.run_until([this] { return rest.has_value(); }, 60s));
  }

  std::optional<Rest> rest;
  std::size_t commands = 0;  // that the robot received, stops too
  std::size_t stops = 0;

 private:
  boost::asio::awaitable<void> run() {
    experiments::RestRequest request{"r1", "anna", "experiment:7"};
    rest = co_await experiments::bring_to_rest(station, clock, std::move(request));
  }

  // Live samples in manual at duty 0, also before the command, as of a schedule that is just at 0.
  boost::asio::awaitable<void> obey(TestRobot& robot, std::optional<microseconds> answers_after) {
    struct Owed {
      std::int64_t at_us = 0;
      protocol::RobotFrame answer = rheonaut_RobotFrame_init_zero;
    };
    std::deque<Owed> owed;
    for (std::uint64_t seq = 0;; seq += 5) {
      robot.send_samples(seq, 5, robot.robot_now_us() - 40'000, 0);
      const std::vector<protocol::Command> received = robot.commands();
      for (; commands < received.size(); ++commands) {
        if (received[commands].which_action == rheonaut_Command_emergency_stop_tag) ++stops;
        Owed& each = owed.emplace_back();
        each.at_us = clock.steady_us() + answers_after.value_or(1h).count();
        each.answer.which_body = rheonaut_RobotFrame_command_ack_tag;
        each.answer.body.command_ack.command_id = received[commands].command_id;
        each.answer.body.command_ack.result = rheonaut_COMMAND_RESULT_ACCEPTED;
        each.answer.body.command_ack.effect_at_robot_us = robot.robot_now_us();
      }
      for (; !owed.empty() && owed.front().at_us <= clock.steady_us(); owed.pop_front())
        robot.send(owed.front().answer);
      co_await clock.sleep_for(50ms);
    }
  }
};

class LateRobotRestTest : public RobotRestTest, public ::testing::WithParamInterface<int> {};

// A command of bring_to_rest lives 1 s; the answer to the first one must count, since that to any other is as late.
TEST_P(LateRobotRestTest, AnAnswerWithinASecondAfterTheCommandsLifeIsNoReasonToStop) {
  bring_to_rest(std::chrono::milliseconds{GetParam()});
  EXPECT_EQ(*rest, Rest::at_rest);
  EXPECT_EQ(stops, 0u);
  EXPECT_EQ(commands, 1u);
}

INSTANTIATE_TEST_SUITE_P(Milliseconds, LateRobotRestTest, ::testing::Values(10, 900, 1200, 1900));

TEST_F(RobotRestTest, ARobotThatNeverAnswersIsStopped) {
  bring_to_rest(std::nullopt);
  EXPECT_EQ(*rest, Rest::stopped);
  EXPECT_GT(stops, 0u);
}

}  // namespace
}  // namespace server
