// What a request says besides its command: its key, its age, what to wait for; and control, over the routes.
#include <gmock/gmock.h>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class CommandRoutesTest : public ApiTest {
 protected:
  static constexpr const char* kCommands = "/api/v1/robots/r1/commands";
  const json duty_{{"kind", "set_duty"}, {"duty", 0.25}};

  std::shared_ptr<std::optional<Answered>> begin_with_key(const std::string& target, const json& body,
                                                          const std::string& key) {
    return begin("POST", target, body, {{"idempotency-key", key}});
  }
  void accept(std::size_t which, std::uint64_t emergency_id = 0) {
    robot->acknowledge(robot->commands().at(which), rheonaut_COMMAND_RESULT_ACCEPTED, emergency_id);
    clock.settle();
  }
};

TEST_F(CommandRoutesTest, ARetriedPostNeverSendsTwice) {
  connect_robot();
  const auto first = begin_with_key(kCommands, duty_, "try-1");
  accept(0);
  const Answered answered = end(first);
  EXPECT_EQ(answered.status, 200);
  const Answered again = end(begin_with_key(kCommands, duty_, "try-1"));
  EXPECT_EQ(again.status, 200);
  EXPECT_EQ(again.parsed()["command_id"], answered.parsed()["command_id"]);
  EXPECT_EQ(robot->commands().size(), 1U);
  const Answered other = end(begin_with_key(kCommands, {{"kind", "set_duty"}, {"duty", 0.5}}, "try-1"));
  EXPECT_EQ(other.status, 422);
  EXPECT_EQ(other.parsed()["reason"], "key_reused");
  EXPECT_EQ(end(begin_with_key(kCommands, duty_, "not a key")).status, 400);
  EXPECT_EQ(robot->commands().size(), 1U);
}

// The memory of another station: only the database knows the command.
TEST_F(CommandRoutesTest, WhatEndedInAnEarlierLifeOfTheStationIsFoundInTheDatabase) {
  connect_robot();
  CommandRecord old;
  old.id = command_id_of("r1", "token:local", "try-1");
  old.robot_id = "r1";
  old.kind = "set_duty";
  old.arguments = R"({"duty":0.25})";
  old.state = CommandState::verified;
  old.submitted_at_us = old.ended_at_us = clock.utc_us();
  recorder.on_command(old);
  clock.run_for(1s);
  const Answered answered = end(begin_with_key(kCommands, duty_, "try-1"));
  EXPECT_EQ(answered.status, 200);
  EXPECT_EQ(answered.parsed()["state"], "verified");
  EXPECT_TRUE(robot->commands().empty());
}

TEST_F(CommandRoutesTest, AStopIsCarriedOutWhateverItsKey) {
  connect_robot();
  const auto asked = begin_with_key("/api/v1/robots/r1/emergency-stop", nullptr, "not a key");
  ASSERT_EQ(robot->commands().size(), 1U);
  accept(0, 9);
  EXPECT_EQ(end(asked).status, 200);
}

TEST_F(CommandRoutesTest, TheLifeOfACommandCountsFromWhenItWasIssued) {
  connect_robot();
  json late = duty_;
  late["life_ms"] = 500;
  late["issued_at_us"] = clock.utc_us() - 600'000;
  const Answered answered = ask("POST", kCommands, late);
  EXPECT_EQ(answered.status, 504);
  EXPECT_EQ(answered.parsed()["reason"], "too_old_on_arrival");
  EXPECT_EQ(answered.parsed()["command"]["life_from"], "issued_at");
  EXPECT_TRUE(robot->commands().empty());

  late.erase("issued_at_us");
  late["stamp_us"] = clock.steady_us() - 400'000;
  begin("POST", kCommands, late);
  ASSERT_EQ(robot->commands().size(), 1U);
  EXPECT_LE(robot->commands()[0].valid_until_robot_us, robot->robot_now_us() + 100'000);

  late["issued_at_us"] = clock.utc_us();
  EXPECT_EQ(ask("POST", kCommands, late).status, 400) << "two ways to say it";
  late.erase("stamp_us");
  late["issued_at_us"] = clock.utc_us() + 5'000'000;
  EXPECT_EQ(ask("POST", kCommands, late).status, 422) << "a clock that is ahead";
  late.erase("issued_at_us");
  late["stamp_us"] = clock.steady_us() + 1;
  EXPECT_EQ(ask("POST", kCommands, late).status, 422);
}

TEST_F(CommandRoutesTest, WaitsUntilItIsVerifiedWhenAsked) {
  connect_robot();
  const auto asked = begin("POST", std::string{kCommands} + "?wait=verified", duty_);
  accept(0);
  EXPECT_FALSE(asked->has_value());
  auto frame = TestRobot::samples_frame(0, 1, robot->robot_now_us(), 0);
  frame.body.telemetry.duty[0] = 0.25F;
  robot->send(frame);
  clock.settle();
  const Answered answered = end(asked);
  EXPECT_EQ(answered.parsed()["state"], "verified");
  EXPECT_GE(answered.parsed()["verified_after_us"], answered.parsed()["acknowledged_after_us"]);
  EXPECT_EQ(ask("POST", std::string{kCommands} + "?wait=long", duty_).status, 400);
}

TEST_F(CommandRoutesTest, StopTimesAreAHistogram) {
  connect_robot();
  const auto asked = begin("POST", "/api/v1/robots/r1/emergency-stop");
  clock.run_for(300us);
  accept(0, 9);
  end(asked);
  const std::string metrics = ask("GET", "/metrics").body;
  const char* acknowledged =
      "rheonaut_emergency_stop_seconds_bucket{stage=\"acknowledged\",le=\"0.0002\"} 0\n"
      "rheonaut_emergency_stop_seconds_bucket{stage=\"acknowledged\",le=\"0.0005\"} 1\n";
  EXPECT_THAT(metrics, HasSubstr(acknowledged));
  EXPECT_THAT(metrics, HasSubstr("rheonaut_emergency_stop_seconds_count{stage=\"duty_zero_seen\"} 0\n"));
  EXPECT_THAT(metrics, HasSubstr("# TYPE rheonaut_emergency_stop_seconds histogram\n"));
}

TEST_F(CommandRoutesTest, ControlIsTakenAndGivenBack) {
  connect_robot();
  const std::string control = "/api/v1/robots/r1/control";
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["control"], nullptr);
  EXPECT_EQ(ask("POST", control, {{"action", "release"}}).status, 409);
  const Answered taken = ask("POST", control, {{"action", "take"}, {"lease_ms", 60'000}});
  EXPECT_EQ(taken.parsed()["control"]["holder"], "token:local");
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["control"]["holder"], "token:local");
  EXPECT_EQ(ask("POST", control, {{"action", "release"}}).parsed()["control"], nullptr);
  for (const json& wrong : {json{{"action", "seize"}}, json{{"action", "take"}, {"lease_ms", 600'001}}}) {
    EXPECT_EQ(ask("POST", control, wrong).status, 422) << wrong;
  }
  for (const json& wrong : {json{{"action", "force"}}, json{{"action", "take"}, {"reason", "why"}},
                            json{{"action", "release"}, {"lease_ms", 1}}, json::object()}) {
    EXPECT_EQ(ask("POST", control, wrong).status, 400) << wrong;
  }
  EXPECT_EQ(ask("POST", "/api/v1/robots/r9/control", {{"action", "take"}}).status, 404);
}

TEST_F(CommandRoutesTest, WhoIsNotInControlIsToldWhoIs) {
  connect_robot();
  ASSERT_TRUE(station.control({"r1", "session:7", "", ControlAction::take, kControlLife, ""}));
  const Answered answered = ask("POST", kCommands, duty_);
  EXPECT_EQ(answered.status, 409);
  EXPECT_EQ(answered.parsed()["reason"], "not_in_control");
  EXPECT_THAT(answered.parsed()["detail"].get<std::string>(), HasSubstr("session:7"));
  EXPECT_TRUE(robot->commands().empty());
}

}  // namespace
}  // namespace server
