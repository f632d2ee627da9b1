// A controller that is kept, sent to a robot with one call: what is sent, when it counts as verified, what is refused.
#include <gmock/gmock.h>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

json pd() { return {{"kp", 29.971237}, {"kd", 0.10523527}, {"mu", 0.94550043}}; }

// As a job `tune` leaves it.
json tuned(double dc_gain = 29.971237) {
  json document = pd();
  document["feasible"] = true;
  document["discretised"] = {{"period_s", 0.01},
                             {"dc_gain", dc_gain},
                             {"noise_gain", 300},
                             {"sections", {{"direct", 20}, {"first_order", {{{"pole", 0.5}, {"residue", 5}}}}}}};
  return document;
}

class PushRoutesTest : public ApiTest {
 protected:
  static constexpr const char* kController = "/api/v1/robots/r1/controller";

  void keep(const json& document, const char* kind = "controller") {
    ASSERT_EQ(ask("POST", "/api/v1/designs", {{"kind", kind}, {"name", "one"}, {"document", document}}).status, 201);
  }
  void report(protocol::Controller controller) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_controller_tag;
    frame.body.controller = controller;
    robot->send(frame);
    clock.settle();
  }
  void connect_with_range(float duty_min, float duty_max) {
    connect_robot();
    protocol::Controller controller = rheonaut_Controller_init_zero;
    controller.controller_id = 2;
    controller.period_us = 10'000;
    controller.kp = 65;
    controller.duty_min = duty_min;
    controller.duty_max = duty_max;
    report(controller);
  }
  using Asked = std::shared_ptr<std::optional<Answered>>;
  Asked push(const json& body, const std::map<std::string, std::string>& headers = {}) {
    const std::size_t before = robot->commands().size();
    const Asked asked = begin("POST", kController, body, headers);
    EXPECT_TRUE(clock.run_until([&] { return asked->has_value() || robot->commands().size() > before; }, 5s));
    return asked;
  }
  std::string refusal(const json& body) { return end(push(body)).parsed()["reason"]; }
};

TEST_F(PushRoutesTest, SendsTheCoefficientsOfTheDesignAndComparesWhatTheRobotReports) {
  connect_with_range(-0.5F, 0.75F);
  json document = tuned();
  document["plant_doubts_text"] = "in doubt: the residuals drift";
  keep(document);
  const Asked asked = push({{"design_id", 1}});
  ASSERT_EQ(robot->commands().size(), 1U);
  const protocol::Command sent = robot->commands().back();
  const protocol::Controller controller = sent.action.set_controller;
  EXPECT_EQ(controller.kp, 29.971237F);
  EXPECT_EQ(controller.direct, 25.0F);
  ASSERT_EQ(controller.pole_count, 1);
  EXPECT_EQ(controller.pole[0], 0.5F);
  EXPECT_EQ(controller.residue[0], 2.5F);
  EXPECT_EQ(controller.duty_min, -0.5F) << "that of the controller in force";
  robot->acknowledge(sent, rheonaut_COMMAND_RESULT_ACCEPTED);
  clock.settle();
  EXPECT_FALSE(asked->has_value()) << "it waits for the robot's report";
  report(controller);
  const Answered answered = end(asked);
  ASSERT_EQ(answered.status, 200) << answered.body;
  const json answer = answered.parsed();
  EXPECT_EQ(answer["design_id"], 1);
  EXPECT_EQ(answer["plant_doubts_text"], "in doubt: the residuals drift");
  EXPECT_EQ(answer["verified"], true);
  EXPECT_EQ(answer["command"]["state"], "verified");
  EXPECT_EQ(answer["in_force"], ask("GET", kController).parsed());
  EXPECT_EQ(answer["in_force"]["controller"]["checksum"], controller.checksum);
}

TEST_F(PushRoutesTest, IsNotVerifiedBeforeTheRobotHasReportedIt) {
  connect_with_range(-1, 1);
  keep(tuned());
  const Asked asked = push({{"design_id", 1}});
  robot->keep_talking();
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
  const Answered answered = end(asked, 30s);
  ASSERT_EQ(answered.status, 200) << answered.body;
  EXPECT_EQ(answered.parsed()["verified"], false);
  EXPECT_EQ(answered.parsed()["in_force"]["controller"]["controller_id"], 2);
}

TEST_F(PushRoutesTest, AnotherControllerThanWasSentIsAFailure) {
  connect_with_range(-1, 1);
  keep(tuned());
  const Asked asked = push({{"design_id", 1}});
  protocol::Controller other = robot->commands().back().action.set_controller;
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
  other.pole[0] = 0.5F + 1e-7F;
  report(other);
  EXPECT_EQ(end(asked, 30s).status, 409);
}

TEST_F(PushRoutesTest, DiscretisesADesignThatHasOnlyItsThreeNumbers) {
  connect_with_range(0, 1);
  keep(pd());
  push({{"design_id", 1}});
  ASSERT_EQ(robot->commands().size(), 1U);
  const protocol::Controller controller = robot->commands().back().action.set_controller;
  EXPECT_EQ(controller.kp, 29.971237F);
  EXPECT_GE(controller.pole_count, 3);
  EXPECT_EQ(controller.period_us, 10'000U);
  for (pb_size_t i = 0; i < controller.pole_count; ++i) EXPECT_GT(controller.pole[i], -0.2F) << "the method with a = 0";
}

TEST_F(PushRoutesTest, RefusesWhatIsNoControllerOrNotThere) {
  connect_with_range(-1, 1);
  keep({{"kp", 0.1}, {"b1", 0.0057}, {"b2", 0.11}, {"alpha", 1.7}, {"beta", 0.87}}, "model");
  keep(tuned(31));
  EXPECT_EQ(refusal({{"design_id", 1}}), "other_kind");
  EXPECT_EQ(refusal({{"design_id", 2}}), "no_controller") << "its coefficients are another controller's";
  EXPECT_EQ(refusal({{"design_id", 3}}), "no_such_design");
  EXPECT_EQ(refusal({{"design_id", 0}}), "out_of_range");
  EXPECT_EQ(refusal(json::object()), "missing_member");
  EXPECT_EQ(refusal({{"design_id", 2}, {"controller", pd()}}), "unknown_member");
  EXPECT_TRUE(robot->commands().empty());
}

// SAFETY's test: the rights are those of set_controller.
TEST_F(PushRoutesTest, NeedsTheRightsOfSetController) {
  connect_with_range(-0.25F, 0.5F);
  keep(tuned());
  EXPECT_EQ(refusal({{"design_id", 1}, {"duty_max", 0.6}}), "confirm_required");
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(refusal({{"design_id", 1}, {"duty_max", 0.6}, {"confirm", true}}), "not_permitted");
  EXPECT_TRUE(robot->commands().empty());
  session = 7;
  EXPECT_EQ(refusal({{"design_id", 1}}), "stamp_required") << "a page says what it has seen";
  session = 0;
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(end(push({{"design_id", 1}})).status, 403);
  scopes = identity::Scopes::of(identity::Role::operator_);
  push({{"design_id", 1}});
  EXPECT_EQ(robot->commands().size(), 1U);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r9/controller", {{"design_id", 1}}).status, 404);
}

TEST_F(PushRoutesTest, ARepeatUnderItsKeySendsNothing) {
  connect_with_range(-1, 1);
  keep(tuned());
  const std::map<std::string, std::string> key{{"idempotency-key", "push-1"}};
  const Asked first = push({{"design_id", 1}}, key);
  const protocol::Command sent = robot->commands().back();
  robot->acknowledge(sent, rheonaut_COMMAND_RESULT_ACCEPTED);
  report(sent.action.set_controller);
  const json answer = end(first).parsed();
  const json again = end(push({{"design_id", 1}}, key)).parsed();
  EXPECT_EQ(again["command"]["command_id"], answer["command"]["command_id"]);
  EXPECT_EQ(robot->commands().size(), 1U);
}

// The one call back.
TEST_F(PushRoutesTest, TheControllerBeforeComesBackWithOneCall) {
  connect_with_range(-1, 1);
  keep(tuned());
  const Asked asked = push({{"design_id", 1}});
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
  report(robot->commands().back().action.set_controller);
  ASSERT_EQ(end(asked).parsed()["verified"], true);
  const auto back = begin("POST", "/api/v1/robots/r1/commands?wait=verified", {{"kind", "restore_controller"}});
  ASSERT_EQ(robot->commands().size(), 2U);
  EXPECT_EQ(robot->commands().back().which_action, rheonaut_Command_restore_controller_tag);
}

}  // namespace
}  // namespace server
