// Parameters and controllers are verified by what the robot says after them, bit for bit.
#include <bit>
#include <cstring>

#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

class ReadBackTest : public LinkTest {
 protected:
  static protocol::Command command_of(pb_size_t action) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = action;
    return command;
  }
  static protocol::Command set_parameter(const char* name, float value) {
    protocol::Command command = command_of(rheonaut_Command_set_parameter_tag);
    std::strncpy(command.action.set_parameter.name, name, sizeof command.action.set_parameter.name - 1);
    command.action.set_parameter.value = value;
    return command;
  }
  static protocol::Controller controller(std::uint32_t id) {
    protocol::Controller controller = rheonaut_Controller_init_zero;
    controller.controller_id = id;
    controller.period_us = 10'000;
    controller.kp = 65.0028F;
    controller.pole_count = controller.residue_count = 2;
    controller.pole[0] = 0.5F;
    controller.residue[1] = -0.25F;
    controller.duty_max = 1;
    return controller;
  }
  static protocol::Command set_controller(const protocol::Controller& controller) {
    protocol::Command command = command_of(rheonaut_Command_set_controller_tag);
    command.action.set_controller = controller;
    return command;
  }
  void say(const protocol::Controller& controller) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_controller_tag;
    frame.body.controller = controller;
    robot->send(frame);
    clock.settle();
  }
  void say_page(std::uint64_t command_id, std::uint32_t first_index, const char* name, float value) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
    protocol::ParameterPage& page = frame.body.parameter_page;
    page.command_id = command_id;
    page.first_index = first_index;
    page.total = 1;
    page.parameters_count = 1;
    std::strncpy(page.parameters[0].name, name, sizeof page.parameters[0].name - 1);
    page.parameters[0].value = value;
    robot->send(frame);
    clock.settle();
  }
  // Sends it and lets the robot accept it; its id.
  std::uint64_t accepted(const protocol::Command& command) {
    station::CommandRequest request = request_of(command);
    request.until_verified = true;
    submit(std::move(request));
    clock.settle();
    const protocol::Command sent = robot->commands().back();
    robot->acknowledge(sent, rheonaut_COMMAND_RESULT_ACCEPTED);
    clock.settle();
    return sent.command_id;
  }
  std::string end() const { return end(results.size() - 1); }
  std::string end(std::size_t which) const {
    return text(results.at(which)->state) + std::string{" "} + results.at(which)->reason;
  }
  static protocol::Controller with_gain(std::uint32_t id, float kp) {
    protocol::Controller out = controller(id);
    out.kp = kp;
    return out;
  }
  const std::optional<protocol::Controller>& former() { return station.settings("r1")->controller_before; }

  TestRobot* robot = connect();
};

TEST_F(ReadBackTest, AParameterIsVerifiedByThePageThatAnswersItBitForBit) {
  const float value = 0.1F, neighbour = std::bit_cast<float>(std::bit_cast<std::uint32_t>(value) + 1);
  auto id = accepted(set_parameter("duty_slew_per_s", value));
  say_page(id + 1, 0, "duty_slew_per_s", neighbour);
  say_page(0, 0, "duty_slew_per_s", value);
  EXPECT_TRUE(results.empty()) << "another page says nothing of it";
  say_page(id, 0, "duty_slew_per_s", value);
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "verified ");
  EXPECT_GE(results.back()->verified_after_us, results.back()->acknowledged_after_us);

  id = accepted(set_parameter("duty_slew_per_s", value));
  say_page(id, 0, "duty_slew_per_s", neighbour);
  EXPECT_EQ(end(), "failed read_back_differs");
  id = accepted(set_parameter("duty_slew_per_s", 0.0F));
  say_page(id, 0, "duty_slew_per_s", -0.0F);
  EXPECT_EQ(end(), "failed read_back_differs");
  id = accepted(set_parameter("duty_slew_per_s", value));
  say_page(id, 0, "another", value);
  EXPECT_EQ(end(), "failed read_back_differs");
}

// A robot writes each page when it sends it: of two in one burst both pages hold the value of the second.
TEST_F(ReadBackTest, AParameterThatANewerCommandHasSetAgainIsSuperseded) {
  const auto first = accepted(set_parameter("duty_slew_per_s", 1));
  const auto second = accepted(set_parameter("duty_slew_per_s", 2));
  say_page(first, 0, "duty_slew_per_s", 2);
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "superseded by_a_newer_command");
  say_page(second, 0, "duty_slew_per_s", 2);
  EXPECT_EQ(end(), "verified ");
}

TEST_F(ReadBackTest, AParameterThatNoNewerCommandHasSetSoDiffers) {
  accepted(set_parameter("duty_slew_per_s", 2));
  const auto one = accepted(set_parameter("duty_slew_per_s", 1));
  accepted(set_parameter("another", 2));
  say_page(one, 0, "duty_slew_per_s", 2);
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "failed read_back_differs") << "an older one, and one of another name";
}

// The acknowledgement of the second may be lost.
TEST_F(ReadBackTest, AParameterIsSupersededByOneWithoutAnAnswerToo) {
  const auto first = accepted(set_parameter("duty_slew_per_s", 1));
  submit(set_parameter("duty_slew_per_s", 2));
  clock.settle();
  say_page(first, 0, "duty_slew_per_s", 2);
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "superseded by_a_newer_command");
}

TEST_F(ReadBackTest, APageIsVerifiedByItsFirstIndex) {
  protocol::Command page = command_of(rheonaut_Command_get_parameters_tag);
  page.action.get_parameters.first_index = 6;
  say_page(accepted(page), 6, "a", 1);
  EXPECT_EQ(end(), "verified ");
  say_page(accepted(page), 0, "a", 1);
  EXPECT_EQ(end(), "failed read_back_differs");
}

TEST_F(ReadBackTest, AControllerIsVerifiedWhenItComesIntoForceAndIsTheSameThroughout) {
  accepted(set_controller(controller(7)));
  say(controller(1));
  EXPECT_TRUE(results.empty()) << "in auto the one before stays for a while";
  say(controller(7));
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "verified ");

  const auto differs = [this](void (*change)(protocol::Controller&)) {
    accepted(set_controller(controller(8)));
    protocol::Controller other = controller(8);
    change(other);
    say(other);
    return end() == "failed read_back_differs";
  };
  EXPECT_TRUE(differs([](auto& other) { ++other.checksum; }));
  EXPECT_TRUE(differs([](auto& other) { other.residue[1] = -0.25000003F; }));
  EXPECT_TRUE(differs([](auto& other) { other.pole_count = 1; }));
  EXPECT_TRUE(differs([](auto& other) { other.duty_max = 0.5F; }));
  EXPECT_TRUE(differs([](auto& other) { other.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT; }));
  EXPECT_TRUE(differs([](auto& other) { other.biquad_a2_count = 1; }));
}

// A robot at rest says once for both which controller is in force.
TEST_F(ReadBackTest, AControllerThatANewerCommandHasReplacedIsSupersededAlsoUnderOneId) {
  say(with_gain(7, 1));
  accepted(set_controller(with_gain(7, 2)));
  accepted(set_controller(with_gain(7, 3)));
  accepted(set_controller(with_gain(8, 4)));
  say(with_gain(8, 4));
  ASSERT_EQ(results.size(), 3U);
  EXPECT_EQ(end(0), "superseded by_a_newer_command");
  EXPECT_EQ(end(1), "superseded by_a_newer_command");
  EXPECT_EQ(end(2), "verified ");

  accepted(set_controller(with_gain(7, 5)));
  accepted(set_controller(with_gain(7, 6)));
  say(with_gain(7, 7));
  EXPECT_EQ(end(3), "failed read_back_differs") << "none of them has ordered it";
  EXPECT_EQ(end(4), "failed read_back_differs");
}

TEST_F(ReadBackTest, AControllerOfTheSameIdThatStillIsInForceIsNoDifference) {
  say(with_gain(7, 1));
  accepted(set_controller(with_gain(7, 2)));
  say(with_gain(7, 1));
  EXPECT_TRUE(results.empty());
  say(with_gain(7, 2));
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "verified ");
}

TEST_F(ReadBackTest, ARestoreIsVerifiedByTheControllerThatWasInForceBefore) {
  say(controller(1));
  accepted(set_controller(controller(2)));
  say(controller(2));
  accepted(command_of(rheonaut_Command_restore_controller_tag));
  say(controller(2));
  EXPECT_EQ(results.size(), 1U) << "in auto it stays for a while";
  say(controller(1));
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(end(), "verified ");
  ASSERT_TRUE(former());
  EXPECT_EQ(former()->controller_id, 2U) << "it swaps the two";
  accepted(command_of(rheonaut_Command_restore_controller_tag));
  say(controller(3));
  EXPECT_EQ(end(), "failed read_back_differs");
}

TEST_F(ReadBackTest, TheControllerOfAnotherCommandVerifiesNoRestore) {
  say(controller(1));
  accepted(command_of(rheonaut_Command_restore_controller_tag));  // of what the station has not seen go
  accepted(set_controller(controller(5)));
  say(controller(5));
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(end(0), "superseded by_a_newer_command");
  EXPECT_EQ(end(1), "verified ");

  accepted(set_controller(controller(6)));
  accepted(command_of(rheonaut_Command_restore_controller_tag));
  say(controller(6));
  ASSERT_EQ(results.size(), 3U);
  EXPECT_EQ(end(2), "verified ");
  say(controller(5));
  ASSERT_EQ(results.size(), 4U);
  EXPECT_EQ(end(3), "verified ");
}

TEST_F(ReadBackTest, AChangeThatARestoreHasTurnedBackIsSuperseded) {
  say(controller(1));
  accepted(set_controller(controller(2)));
  accepted(command_of(rheonaut_Command_restore_controller_tag));
  say(controller(1));
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(end(0), "superseded by_a_newer_command");
  EXPECT_EQ(end(1), "verified ");
}

// It comes after each Welcome, whatever was commanded since.
TEST_F(ReadBackTest, TheControllerThatIsReportedUnaskedVerifiesNoRestore) {
  accepted(command_of(rheonaut_Command_restore_controller_tag));
  say(controller(1));
  EXPECT_TRUE(results.empty());
  say(controller(2));
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "verified ");
}

// SAFETY's test: at rest the robot now restores the second, in auto the first; a wider one needs an admin.
TEST_F(ReadBackTest, AfterTwoControllersInOneBurstItIsNotKnownWhatARestoreBringsBack) {
  say(controller(1));
  accepted(set_controller(controller(2)));
  accepted(set_controller(controller(3)));
  say(controller(3));
  EXPECT_FALSE(former());
}

TEST_F(ReadBackTest, WhatTheRobotHasHadBeforeIsNotWaitedFor) {
  station::CommandRequest request = request_of(set_controller(controller(7)));
  request.until_verified = true;
  submit(std::move(request));
  clock.settle();
  protocol::RobotFrame answer = rheonaut_RobotFrame_init_zero;
  answer.which_body = rheonaut_RobotFrame_command_ack_tag;
  answer.body.command_ack.command_id = robot->commands().back().command_id;
  answer.body.command_ack.result = rheonaut_COMMAND_RESULT_DUPLICATE;
  robot->send(answer);
  clock.settle();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(end(), "unknown duplicate");
}

TEST_F(ReadBackTest, ARestoreOfWhatTheStationHasNotSeenIsVerifiedByTheControllerThatIsReportedAfterIt) {
  say(controller(1));
  accepted(command_of(rheonaut_Command_restore_controller_tag));
  EXPECT_TRUE(results.empty());
  say(controller(3));
  EXPECT_EQ(end(), "verified ");
}

TEST_F(ReadBackTest, WhatIsNotReadBackIsOnlyAcknowledged) {
  accepted(set_controller(controller(7)));
  EXPECT_TRUE(clock.run_until([&] { return !results.empty(); }, 6s));
  EXPECT_EQ(end(), "acknowledged no_read_back");
  accepted(set_parameter("a", 1));
  robot->link.cut();
  clock.settle();
  EXPECT_EQ(end(), "acknowledged link_lost");
}

// A controller whose range is wider than the one in force needs an admin: the station has to know what comes back.
TEST_F(ReadBackTest, KnowsTheControllerThatARestoreBringsBackAsLongAsItHasSeenItGo) {
  const auto before = [this] { return station.settings("r1")->controller_before; };
  say(controller(1));
  EXPECT_FALSE(before());
  say(controller(2));
  ASSERT_TRUE(before());
  EXPECT_EQ(before()->controller_id, 1U);
  say(controller(2));
  EXPECT_FALSE(before()) << "a change that was turned back before it came into force: which one is behind it?";
  say(controller(3));
  robot->link.cut();
  clock.settle();
  EXPECT_FALSE(station.find("r1")->link == station::LinkState::connected);
  EXPECT_EQ(station.settings("r1")->controller->controller_id, 3U) << "it is known, and not current";
  robot = connect();
  EXPECT_FALSE(station.settings("r1")->is_controller_current);
  say(controller(4));
  EXPECT_FALSE(before()) << "between connections anything may have happened";
}

TEST_F(ReadBackTest, LimitsThatAreNotAtTheirDefaultBelongToTheState) {
  say_page(0, 0, "auto_limit_s", 0);
  EXPECT_TRUE(station.find("r1")->changed_limits.empty());
  say_page(0, 0, "auto_limit_s", 20);
  const station::ChangedLimit expected{"auto_limit_s", "", 20, 0};
  EXPECT_EQ(sink.robots.back().changed_limits, std::vector{expected});
  EXPECT_FALSE(station::bounds_motion("duty_slew_per_s"));
}

}  // namespace
}  // namespace server
