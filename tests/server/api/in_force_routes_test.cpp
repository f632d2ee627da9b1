// Parameters and controllers over the routes: what is in force, who may change it, and what must be confirmed.
#include <cstring>
#include <functional>
#include <semaphore>

#include "server/station/commands/recent_commands.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class InForceRoutesTest : public ApiTest {
 protected:
  static constexpr const char* kCommands = "/api/v1/robots/r1/commands";
  static constexpr const char* kParameters = "/api/v1/robots/r1/parameters";
  static constexpr const char* kController = "/api/v1/robots/r1/controller";

  void say_parameters() {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
    auto& page = frame.body.parameter_page;
    page.total = page.parameters_count = 2;
    const auto fill = [](rheonaut_Parameter& into, const char* name, float value) {
      into.value = value;
      into.minimum = -100;
      into.maximum = into.default_value = 100;
      std::strncpy(into.name, name, sizeof into.name - 1);
      std::strncpy(into.unit, "m", sizeof into.unit - 1);
    };
    fill(page.parameters[0], "position_limit_max_m", 0.2F);
    fill(page.parameters[1], "duty_slew_per_s", 100);
    robot->send(frame);
    clock.settle();
  }
  void send_controller(float duty_min, float duty_max) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_controller_tag;
    auto& controller = frame.body.controller;
    controller.controller_id = ++id_;
    controller.period_us = 10'000;
    controller.kp = 65.0028F;
    controller.duty_min = duty_min;
    controller.duty_max = duty_max;
    robot->send(frame);
  }
  void say_controller(float duty_min, float duty_max) {
    send_controller(duty_min, duty_max);
    clock.settle();
  }
  static json with_range(double duty_min, double duty_max, bool confirm = false) {
    json body{{"kind", "set_controller"},
              {"controller", {{"period_us", 10'000}, {"kp", 65}, {"direct", 65}}},
              {"duty_min", duty_min},
              {"duty_max", duty_max}};
    if (confirm) body["confirm"] = true;
    return body;
  }
  // The robot accepts it; the record.
  json accepted(const json& body, const char* key) {
    const auto asked = begin("POST", kCommands, body, {{"idempotency-key", key}});
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
    const Answered answered = end(asked);
    EXPECT_EQ(answered.status, 200) << answered.body;
    return answered.parsed();
  }
  Answered again(const json& body, const char* key) {
    return end(begin("POST", kCommands, body, {{"idempotency-key", key}}));
  }
  // The same while something happens at the next controller that the robot reports: the request waits for it.
  Answered overtaken(const json& body, std::function<void()> happens) {
    std::binary_semaphore has_happened{0};
    then_.happens = [&] {
      happens();
      has_happened.release();
    };
    auto reading = [](runtime::WorkerThread& worker, std::binary_semaphore& until) -> boost::asio::awaitable<void> {
      auto job = [&until] {
        until.acquire();
        return true;
      };
      co_await worker.run(std::move(job));
    };
    station.add_sink(then_);
    tasks.spawn("the database is busy", reading(readers, has_happened));
    send_controller(0, 0.5F);
    return again(body, "while-it-waited");
  }
  // "sent", or the reason of the refusal.
  std::string outcome(const json& body) {
    const std::size_t before = robot->commands().size();
    const auto asked = begin("POST", kCommands, body);
    if (robot->commands().size() == before) return end(asked).parsed()["reason"];
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_BUSY);
    EXPECT_EQ(end(asked).parsed()["reason"], "busy");
    return "sent";
  }

 private:
  struct AtController final : station::StationSink {
    void on_in_force(const station::RobotState&, const station::InForceRecord&) override { happens(); }
    std::function<void()> happens;
  };

  std::uint32_t id_ = 1;
  AtController then_;
};

TEST_F(InForceRoutesTest, TheTableSaysWhatIsChangedAndWhatBoundsMotionAndWhetherItIsCurrent) {
  EXPECT_EQ(ask("GET", kParameters).status, 404);
  connect_robot();
  json answer = ask("GET", kParameters).parsed();
  EXPECT_EQ(answer, (json{{"robot_id", "r1"}, {"is_current", false}, {"told_at_us", nullptr}, {"parameters", nullptr}}))
      << "nothing is known, which is no table without parameters";
  say_parameters();
  scopes = identity::Scopes{}.add(identity::Scope::read);
  answer = ask("GET", kParameters).parsed();
  EXPECT_EQ(answer["is_current"], true);
  ASSERT_EQ(answer["parameters"].size(), 2U);
  EXPECT_EQ(answer["parameters"][1], (json{{"name", "position_limit_max_m"},
                                           {"unit", "m"},
                                           {"value", 0.2},
                                           {"minimum", -100.0},
                                           {"maximum", 100.0},
                                           {"default", 100.0},
                                           {"changed", true},
                                           {"bounds_motion", true}}));
  EXPECT_EQ(answer["parameters"][0]["changed"], false);
  EXPECT_EQ(answer["parameters"][0]["bounds_motion"], false);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["changed_limits"],
            (json{{{"name", "position_limit_max_m"}, {"unit", "m"}, {"value", 0.2}, {"default", 100.0}}}));
  robot->link.cut();
  clock.settle();
  answer = ask("GET", kParameters).parsed();
  EXPECT_EQ(answer["is_current"], false);
  EXPECT_EQ(answer["parameters"].size(), 2U) << "what was last known";
  scopes = identity::Scopes{}.add(identity::Scope::stop);
  EXPECT_EQ(ask("GET", kParameters).status, 403);
}

TEST_F(InForceRoutesTest, TheControllerIsShownAsTheRobotSaysIt) {
  EXPECT_EQ(ask("GET", kController).status, 404);
  connect_robot();
  EXPECT_EQ(ask("GET", kController).parsed(),
            (json{{"robot_id", "r1"}, {"is_current", false}, {"told_at_us", nullptr}, {"controller", nullptr}}));
  say_controller(0, 0.5F);
  json answer = ask("GET", kController).parsed();
  EXPECT_EQ(answer["is_current"], true);
  EXPECT_GT(answer["told_at_us"], 0);
  EXPECT_EQ(answer["controller"]["kp"], 65.0028);
  robot->link.cut();
  clock.settle();
  answer = ask("GET", kController).parsed();
  EXPECT_EQ(answer["is_current"], false);
  EXPECT_EQ(answer["controller"]["duty_max"], 0.5);
}

// SAFETY: a wider duty range is more motion.
TEST_F(InForceRoutesTest, AWiderControllerNeedsAnAdminWhoConfirms) {
  connect_robot();
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(outcome(with_range(0, 0.5, true)), "not_permitted") << "the one in force is not known";
  say_controller(-0.25F, 0.5F);
  EXPECT_EQ(outcome(with_range(-0.25, 0.5)), "sent");
  EXPECT_EQ(outcome(with_range(0, 0.4)), "sent");
  EXPECT_EQ(outcome(with_range(0, 0.51, true)), "not_permitted");
  EXPECT_EQ(outcome(with_range(-0.26, 0.5, true)), "not_permitted");
  scopes = identity::Scopes::of(identity::Role::admin);
  EXPECT_EQ(outcome(with_range(-0.25, 0.6)), "confirm_required");
  EXPECT_EQ(outcome(with_range(-0.25, 0.6, true)), "sent");
  json without = with_range(0, 1);
  without.erase("duty_min");
  without.erase("duty_max");
  EXPECT_EQ(outcome(without), "sent");
  EXPECT_EQ(robot->commands().back().action.set_controller.duty_max, 0.5F) << "that of the one in force";
}

TEST_F(InForceRoutesTest, ARestoreNeedsAnAdminUnlessWhatComesBackIsKnownAndNotWider) {
  connect_robot();
  const json restore{{"kind", "restore_controller"}};
  json confirmed = restore;
  confirmed["confirm"] = true;
  say_controller(0, 0.5F);
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(outcome(restore), "not_permitted") << "what comes back is not known";
  say_controller(0, 1);
  EXPECT_EQ(outcome(restore), "sent");
  say_controller(0, 0.25F);
  EXPECT_EQ(outcome(confirmed), "not_permitted");
  scopes = identity::Scopes::of(identity::Role::admin);
  EXPECT_EQ(outcome(restore), "confirm_required");
  EXPECT_EQ(outcome(confirmed), "sent");
}

TEST_F(InForceRoutesTest, AParameterIsVerifiedOverTheRoutes) {
  connect_robot();
  const auto asked = begin("POST", std::string{kCommands} + "?wait=verified",
                           {{"kind", "set_parameter"}, {"name", "duty_slew_per_s"}, {"value", 0.1}});
  const protocol::Command sent = robot->commands().at(0);
  robot->acknowledge(sent, rheonaut_COMMAND_RESULT_ACCEPTED);
  clock.settle();
  EXPECT_FALSE(asked->has_value());
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
  auto& page = frame.body.parameter_page;
  page.command_id = sent.command_id;
  page.parameters_count = 1;
  std::strncpy(page.parameters[0].name, "duty_slew_per_s", sizeof page.parameters[0].name - 1);
  page.parameters[0].value = 0.1F;
  robot->send(frame);
  clock.settle();
  EXPECT_EQ(end(asked).parsed()["state"], "verified");
}

// One key is one command, also where the station fills in what the body leaves out.
TEST_F(InForceRoutesTest, AControllerThatIsSentAgainUnderItsKeyIsTheSameCommand) {
  connect_robot();
  say_controller(-1, 1);
  const auto first = begin("POST", kCommands, with_range(-1, 1), {{"idempotency-key", "c"}});
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED);
  EXPECT_EQ(end(first).status, 200);
  const auto again = begin("POST", kCommands, with_range(-1, 1), {{"idempotency-key", "c"}});
  const json record = end(again).parsed();
  EXPECT_EQ(robot->commands().size(), 1U);
  EXPECT_EQ(record["arguments"]["controller"]["checksum"], robot->commands()[0].action.set_controller.checksum);
}

TEST_F(InForceRoutesTest, ARepeatIsAnsweredAsTheFirstWhateverIsInForceByNow) {
  connect_robot();
  say_controller(-1, 1);
  json set = with_range(-1, 1);
  set.erase("duty_min");
  set.erase("duty_max");
  const json restore{{"kind", "restore_controller"}};
  const json bound{{"kind", "set_parameter"}, {"name", "position_limit_max_m"}, {"value", 0.2}, {"confirm", true}};
  say_controller(-1, 1);
  scopes = identity::Scopes::of(identity::Role::operator_);
  const json restore_first = accepted(restore, "restore");
  scopes = identity::Scopes::of(identity::Role::admin);
  const json set_first = accepted(set, "set"), bound_first = accepted(bound, "bound");
  scopes = identity::Scopes::of(identity::Role::operator_);
  const std::size_t sent = robot->commands().size();

  const auto expect_the_first_answers = [&](const char* when) {
    EXPECT_EQ(again(set, "set").parsed()["command_id"], set_first["command_id"]) << when;
    EXPECT_EQ(again(bound, "bound").parsed()["command_id"], bound_first["command_id"]) << when;
    const json restored = again(restore, "restore").parsed();  // a problem, once another controller was reported
    EXPECT_EQ(restored.value("command", restored)["command_id"], restore_first["command_id"]) << when;
    EXPECT_EQ(again(with_range(-1, 0.5), "set").parsed()["reason"], "key_reused") << when;
    EXPECT_EQ(robot->commands().size(), sent) << when;
  };
  expect_the_first_answers("at once");
  say_controller(0, 0.25F);
  EXPECT_EQ(outcome(restore), "not_permitted");
  expect_the_first_answers("under a narrower controller");
  robot->link.cut();
  clock.settle();
  expect_the_first_answers("while the robot is away");
}

// The memory of another station: only the database knows the command.
TEST_F(InForceRoutesTest, ARepeatIsAnsweredAsTheFirstOverARestartToo) {
  connect_robot();
  say_controller(-1, 1);
  json set = with_range(-1, 1);
  set.erase("duty_min");
  set.erase("duty_max");
  station::CommandRecord old;
  old.id = station::command_id_of("r1", "token:local", "old");
  old.robot_id = "r1";
  old.kind = "set_controller";
  old.arguments = accepted(set, "new")["arguments"].dump();
  old.state = station::CommandState::verified;
  old.submitted_at_us = old.ended_at_us = clock.utc_us();
  recorder.on_command(old);
  clock.run_for(1s);
  say_controller(0, 0.25F);
  const Answered answered = again(set, "old");
  EXPECT_EQ(answered.parsed()["state"], "verified") << answered.body;
  EXPECT_EQ(again(with_range(-1, 0.5), "old").parsed()["reason"], "key_reused");
  EXPECT_EQ(robot->commands().size(), 1U);
}

// SAFETY's test: while a request waits for the database, everything may change.
TEST_F(InForceRoutesTest, WhatMayBoundMotionIsJudgedAfterTheWait) {
  connect_robot();
  say_controller(-1, 1);
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(overtaken(with_range(-1, 1), [] {}).parsed()["reason"], "not_permitted");
  EXPECT_TRUE(robot->commands().empty());
}

TEST_F(InForceRoutesTest, WhoseCredentialEndsDuringTheWaitCommandsNothing) {
  connect_robot();
  const Answered answered = overtaken({{"kind", "ping"}}, [this] { standing->end(); });
  EXPECT_EQ(answered.status, 403) << answered.body;
  EXPECT_EQ(answered.parsed()["reason"], "not_permitted");
  EXPECT_TRUE(robot->commands().empty());
}

TEST_F(InForceRoutesTest, ControllersAndSchedulesAreHeldToTheLimits) {
  connect_robot();
  say_controller(-1, 1);
  EXPECT_EQ(outcome(with_range(-1.5, 1, true)), "out_of_range");
  EXPECT_EQ(outcome(with_range(0.1, 1, true)), "out_of_range");
  EXPECT_EQ(outcome(with_range(0, 0, true)), "sent") << "the robot judges this";
  const json schedule{{"kind", "set_duty_schedule"},
                      {"schedule", {{{"tick", 0}, {"duty", 1.5}}, {{"tick", 1}, {"duty", 0}}}}};
  EXPECT_EQ(outcome(schedule), "out_of_range");
}

}  // namespace
}  // namespace server
