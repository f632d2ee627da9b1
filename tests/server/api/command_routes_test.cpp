// What a request says besides its command: its key, its age, what to wait for; and control, over the routes.
#include <gmock/gmock.h>

#include "server/station/commands/recent_commands.hpp"
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

// SAFETY: a duty of 0 that waits for a disk is too old when it is answered.
TEST_F(CommandRoutesTest, ADiskThatFailsKeepsNoCommandWithAKeyWaiting) {
  connect_robot();
  clock.settle();
  const SQLite::Database lock = lock_disk();
  const auto sent = begin_with_key(kCommands, {{"kind", "set_duty"}, {"duty", 0}}, "rest");
  ASSERT_TRUE(clock.run_until([&] { return robot->commands().size() == 1; }, 100ms));
  accept(0);
  EXPECT_EQ(end(sent).status, 200);
  EXPECT_EQ(end(begin_with_key(kCommands, {{"kind", "set_duty"}, {"duty", 0}}, "rest")).status, 200);
  EXPECT_EQ(robot->commands().size(), 1U) << "the same command";
}

// SAFETY: somebody who stops a robot that is away must know that a restart would lose the stop.
TEST_F(CommandRoutesTest, AStopThatIsKeptAndNotStoredIsNotCalledKept) {
  station::RestoredRobot away;
  away.id = "away";
  station.restore({away}, {});
  const auto stop = [this](const char* target) { return end(begin("POST", target), 20s); };
  {
    const SQLite::Database lock = lock_disk();
    const Answered one = stop("/api/v1/robots/away/emergency-stop");
    EXPECT_EQ(one.status, 503) << one.body;
    EXPECT_EQ(one.parsed()["reason"], "not_stored");
    EXPECT_EQ(one.parsed()["command"]["state"], "queued");
    EXPECT_TRUE(station.find("away")->pending_stop) << "it is kept all the same";
    const Answered all = stop("/api/v1/emergency-stop");
    EXPECT_EQ(all.status, 503) << all.body;
    EXPECT_EQ(all.parsed()["reason"], "not_stored");
    EXPECT_EQ(all.parsed()["summary"]["kept"], 1);
  }
  EXPECT_EQ(stop("/api/v1/robots/away/emergency-stop").status, 202);
  EXPECT_EQ(stop("/api/v1/emergency-stop").status, 202);
  const auto presses = [this] {
    return ask("GET", "/api/v1/audit?action=command.stop_again").parsed()["entries"].size();
  };
  EXPECT_EQ(presses(), 3U) << "each after the first";
}

TEST_F(CommandRoutesTest, APressThatComesByTwoWaysIsOnePress) {
  station::RestoredRobot away;
  away.id = "away";
  station.restore({away}, {});
  for (int way = 0; way < 2; ++way) {
    EXPECT_EQ(end(begin_with_key("/api/v1/robots/away/emergency-stop", nullptr, "press-1"), 20s).status, 202);
  }
  EXPECT_TRUE(ask("GET", "/api/v1/audit?action=command.stop_again").parsed()["entries"].empty());
}

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
  station::CommandRecord old;
  old.id = station::command_id_of("r1", "token:local", "try-1");
  old.robot_id = "r1";
  old.kind = "set_duty";
  old.arguments = R"({"duty":0.25})";
  old.state = station::CommandState::verified;
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

// SAFETY: a key that the database alone remembers is that of no press of now.
TEST_F(CommandRoutesTest, AStopOfAnEarlierLifeIsNoAnswerToAStopOfNow) {
  connect_robot();
  station::CommandRecord old;
  old.id = station::command_id_of("r1", "token:local", "press-1");
  old.robot_id = "r1";
  old.kind = "emergency_stop";
  old.arguments = "{}";
  old.state = station::CommandState::verified;
  old.submitted_at_us = old.ended_at_us = clock.utc_us();
  recorder.on_command(old);
  clock.run_for(1s);
  robot->send(TestRobot::samples_frame(0, 5, robot->robot_now_us(), 7));  // latched, by something else
  clock.settle();
  EXPECT_EQ(end(begin_with_key(kCommands, duty_, "press-1")).parsed()["reason"], "key_reused");
  begin_with_key("/api/v1/robots/r1/emergency-stop", nullptr, "press-1");
  EXPECT_EQ(robot->commands().size(), 1U);
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

// SAFETY: a page's request is refused when its operator saw an old state; only a stop needs no stamp.
TEST_F(CommandRoutesTest, APageSaysWhatItsOperatorSaw) {
  connect_robot();
  session = 1;
  const std::string control = "/api/v1/robots/r1/control";
  json by_clock = duty_;
  by_clock["issued_at_us"] = clock.utc_us();
  for (const json& blind : {duty_, by_clock}) {
    const Answered answered = ask("POST", kCommands, blind);
    EXPECT_EQ(answered.status, 422) << blind;
    EXPECT_EQ(answered.parsed()["reason"], "stamp_required") << blind;
  }
  for (json body : {json{{"action", "take"}}, json{{"action", "force"}, {"reason", "r"}}}) {
    EXPECT_EQ(ask("POST", control, body).parsed()["reason"], "stamp_required") << body;
    body["stamp_us"] = clock.steady_us() - 400'001;
    EXPECT_EQ(ask("POST", control, body).parsed()["reason"], "stale") << body;
    body["stamp_us"] = clock.steady_us() + 1;
    EXPECT_EQ(ask("POST", control, body).parsed()["reason"], "out_of_range") << body;
  }
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["control"], nullptr) << "what was refused took no control";
  EXPECT_TRUE(robot->commands().empty());

  json old = duty_;
  old["stamp_us"] = clock.steady_us() - 400'001;
  EXPECT_EQ(ask("POST", kCommands, old).parsed()["reason"], "stale") << "nor does an old command";
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["control"], nullptr);
  EXPECT_EQ(ask("POST", control, {{"action", "take"}, {"lease_ms", 3001}, {"stamp_us", clock.steady_us()}}).status, 422)
      << "a page shows that it is there";
  EXPECT_TRUE(robot->commands().empty());

  EXPECT_EQ(ask("POST", control, {{"action", "take"}, {"stamp_us", clock.steady_us() - 400'000}}).status, 200);
  const json renewal{{"kind", "renew_lease"}, {"stamp_us", clock.steady_us() - 400'001}};
  EXPECT_EQ(ask("POST", kCommands, renewal).parsed()["reason"], "stale");
  EXPECT_TRUE(robot->commands().empty());
  begin("POST", kCommands, old);
  EXPECT_EQ(robot->commands().size(), 1U) << "who is in control may send another within its time to live";
  EXPECT_EQ(ask("POST", control, {{"action", "release"}, {"stamp_us", 1}}).status, 400);
  EXPECT_EQ(ask("POST", control, {{"action", "release"}}).status, 200);
  json seen = duty_;
  seen["stamp_us"] = clock.steady_us();
  begin("POST", kCommands, seen);
  EXPECT_EQ(robot->commands().size(), 2U);
  begin("POST", "/api/v1/robots/r1/emergency-stop");
  EXPECT_EQ(robot->commands().size(), 3U);
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

TEST_F(CommandRoutesTest, ARefusalNamesTheHolderOfControl) {
  connect_robot();
  ASSERT_TRUE(station.control({"r1", "session:7", "", station::ControlAction::take, station::kControlLease, ""}));
  const Answered answered = ask("POST", kCommands, duty_);
  EXPECT_EQ(answered.status, 409);
  EXPECT_EQ(answered.parsed()["reason"], "not_in_control");
  EXPECT_THAT(answered.parsed()["detail"].get<std::string>(), HasSubstr("session:7"));
  EXPECT_TRUE(robot->commands().empty());
}

}  // namespace
}  // namespace server
