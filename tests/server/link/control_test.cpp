// Control of a robot: only its holder moves the robot, and everyone may stop it.
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

class ControlTest : public LinkTest {
 protected:
  void submit_as(const std::string& actor, protocol::Command action) {
    station::CommandRequest request = request_of(action);
    request.actor = actor;
    submit(std::move(request));
    clock.settle();
  }
  // A robot whose link takes nothing any more, for now.
  TestRobot* connect_and_stall() {
    auto* robot = dial(64);
    robot->say_hello();
    EXPECT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
    robot->link.stall(true);
    for (int i = 0; i < 4; ++i) submit_as("someone", ping());  // what still fits into the link
    return robot;
  }
  void fill_queue() {
    const std::size_t before = results.size();
    for (std::size_t i = 0; i < link::RobotOutbox::kMaxQueuedCommands && results.size() == before; ++i) {
      submit_as("someone", ping());
    }
    EXPECT_EQ(results.size(), before + 1);
    EXPECT_EQ(results.back().error().reason, "queue_full");
  }
  // The robot takes all that waits, and answers it.
  void drain(TestRobot& robot) {
    robot.link.stall(false);
    clock.settle();
    for (std::size_t answered = 0; answered < robot.commands().size(); clock.settle()) {
      robot.acknowledge(robot.commands()[answered++], rheonaut_COMMAND_RESULT_ACCEPTED);
    }
  }
  static protocol::Command ping() {  // of which none supersedes another, and which needs no control
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_ping_tag;
    return command;
  }
  Result<station::ControlState> control(const std::string& actor, station::ControlAction action) {
    return station.control({"r1", actor, "10.0.0.7", action, station::kControlLease, "a test"});
  }
};

TEST_F(ControlTest, OnlyTheHoldersCommandsReachTheRobot) {
  auto* robot = connect();
  submit_as("session:1", set_duty(0.1F));
  EXPECT_EQ(station.find("r1")->control.holder, "session:1");
  submit_as("token:local", set_duty(0.2F));
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0].error().reason, "not_in_control");
  ASSERT_EQ(robot->commands().size(), 1u);
  EXPECT_FLOAT_EQ(robot->commands()[0].action.set_duty.duty, 0.1F);
}

TEST_F(ControlTest, ACommandThatIsRefusedOrCameTooLateTakesNoControl) {
  auto* robot = connect();
  submit_as("session:1", set_duty(1.5F));
  EXPECT_EQ(results.at(0).error().reason, "out_of_range");
  EXPECT_EQ(station.find("r1")->control.holder, "");
  station::CommandRequest late = request_of(set_duty(0));
  late.actor = "session:1";
  late.age = late.time_to_live;
  submit(std::move(late));
  clock.settle();
  EXPECT_EQ(results.at(1)->state, station::CommandState::expired);
  EXPECT_EQ(station.find("r1")->control.holder, "");
  EXPECT_TRUE(robot->commands().empty());
}

TEST_F(ControlTest, ACommandThatFindsTheQueueFullTakesNoControl) {
  auto* robot = connect_and_stall();
  fill_queue();
  submit_as("session:1", set_duty(0.1F));
  EXPECT_EQ(results.back().error().reason, "queue_full");
  EXPECT_EQ(station.find("r1")->control.holder, "");
  const auto takes = [](const station::RobotEvent& event) { return event.kind == "control_taken"; };
  EXPECT_EQ(std::ranges::count_if(sink.events, takes), 0);
  submit_as("session:2", set_duty(0.2F));
  EXPECT_EQ(results.back().error().reason, "queue_full") << "and not that another is in control";
  drain(*robot);
  submit_as("session:2", set_duty(0.3F));
  EXPECT_EQ(station.find("r1")->control.holder, "session:2");
}

TEST_F(ControlTest, ACommandThatFindsTheQueueFullHasCostNoOlderOne) {
  auto* robot = connect_and_stall();
  submit_as("session:1", set_duty(0.1F));
  fill_queue();
  const std::size_t refused = results.size();
  submit_as("session:1", set_setpoint(0.1F));
  ASSERT_EQ(results.size(), refused + 1);
  EXPECT_EQ(results.back().error().reason, "queue_full");
  submit_as("session:1", set_duty(0.2F));  // takes the place of the older duty
  ASSERT_EQ(results.size(), refused + 2);
  EXPECT_EQ(results.back()->state, station::CommandState::superseded);
  drain(*robot);
  std::vector<float> duties;
  for (const auto& command : robot->commands()) {
    if (command.which_action == rheonaut_Command_set_duty_tag) duties.push_back(command.action.set_duty.duty);
  }
  EXPECT_EQ(duties, std::vector<float>{0.2F});
}

TEST_F(ControlTest, ARenewalOfAnotherKeepsNoMotorRunning) {
  auto* robot = connect();
  submit_as("session:1", set_duty(0.1F));
  protocol::Command renewal = rheonaut_Command_init_zero;
  renewal.which_action = rheonaut_Command_renew_lease_tag;
  submit_as("session:2", renewal);
  EXPECT_EQ(results.at(0).error().reason, "not_in_control");
  EXPECT_EQ(robot->commands().size(), 1u);
}

TEST_F(ControlTest, TheStateHasTheTimeOfTheLatestRenewalThatTheRobotAccepted) {
  auto* robot = connect();
  submit_as("session:1", set_duty(0.1F));
  protocol::Command renewal = rheonaut_Command_init_zero;
  renewal.which_action = rheonaut_Command_renew_lease_tag;
  submit_as("session:1", renewal);
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_REJECTED, 0,
                     rheonaut_REJECT_REASON_NOTHING_TO_RENEW);
  clock.settle();
  EXPECT_EQ(station.find("r1")->lease_renewed_at_us, 0);
  submit_as("session:1", renewal);
  clock.run_for(20ms);
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
  clock.settle();
  EXPECT_EQ(station.find("r1")->lease_renewed_at_us, clock.utc_us());
}

TEST_F(ControlTest, EveryoneMayStop) {
  auto* robot = connect();
  submit_as("session:1", set_duty(0.1F));
  station::StopRequest stop{"r1", "session:2", "", "", 0};
  tasks.spawn("stop", [](station::Station& of, station::StopRequest request) -> boost::asio::awaitable<void> {
    co_await of.emergency_stop(std::move(request), 1s);
  }(station, stop));
  clock.settle();
  EXPECT_EQ(robot->commands().back().which_action, rheonaut_Command_emergency_stop_tag);
}

TEST_F(ControlTest, APageThatGoesSilentLosesControlAndItIsSaid) {
  auto* robot = connect();
  tasks.spawn("control", station.watch_control());
  submit_as("session:1", set_duty(0.1F));
  for (int i = 0; i < 5; ++i) {
    clock.run_for(1s);
    station.keep_control({"session:1", ""}, std::nullopt, 400ms);
  }
  EXPECT_EQ(station.find("r1")->control.holder, "session:1");
  for (int i = 0; i < 4; ++i) {
    clock.run_for(1s);
    station.keep_control({"session:1", ""}, std::nullopt, 401ms);  // SAFETY: an echo of an old picture keeps nothing
    station.keep_control({"session:1", ""}, std::nullopt, -1us);
  }
  EXPECT_EQ(station.find("r1")->control.holder, "");
  EXPECT_EQ(sink.events.back().kind, "control_expired");
  EXPECT_EQ(sink.robots.back().control.holder, "");
  submit_as("session:2", set_duty(0.2F));
  EXPECT_EQ(robot->commands().size(), 2u);
}

TEST_F(ControlTest, EachChangeIsAnEventOfTheRobot) {
  connect();
  ASSERT_TRUE(control("session:1", station::ControlAction::take));
  EXPECT_EQ(sink.events.back().kind, "control_taken");
  ASSERT_TRUE(control("session:2", station::ControlAction::request));
  EXPECT_EQ(sink.robots.back().control.requested_by, "session:2");
  ASSERT_TRUE(control("session:1", station::ControlAction::hand_over));
  EXPECT_EQ(sink.robots.back().control.holder, "session:2");
  ASSERT_TRUE(control("session:1", station::ControlAction::force));
  EXPECT_EQ(sink.events.back().detail, "by session:1 from session:2: a test");
  ASSERT_TRUE(control("session:1", station::ControlAction::release));
  EXPECT_EQ(sink.robots.back().control.holder, "");
}

TEST_F(ControlTest, OfAnUnknownRobotThereIsNone) {
  EXPECT_EQ(control("session:1", station::ControlAction::take).error().reason, "unknown_robot");
}

}  // namespace
}  // namespace server
