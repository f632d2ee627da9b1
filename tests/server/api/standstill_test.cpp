// The station is halted or suspended while commands wait in its sockets: what they may still do when it reads them.
#include "tests/server/api/live_page.hpp"

namespace server {
namespace {

constexpr const char* kCommands = "/api/v1/robots/r1/commands";

class StandstillTest : public ApiTest {
 protected:
  StandstillTest() {
    connect_robot();
    clock.run_for(100ms);
  }

  std::string post(const std::string& target, const json& body) const {
    const std::string text = body.dump();
    return "POST " + target + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token() +
           "\r\nContent-Type: application/json\r\nContent-Length: " + std::to_string(text.size()) + "\r\n\r\n" + text;
  }
  static json set_duty(int life_ms) { return {{"kind", "set_duty"}, {"duty", 0.3}, {"life_ms", life_ms}}; }

  // Sent while the station stands still for so long, and read then.
  void send_during(microseconds standstill, const std::string& request) {
    client.is_held = true;
    client.send(request);
    clock.skip(standstill);
    client.is_held = false;
    clock.settle();
  }
  json answer() {
    const std::string head = client.read_until("\r\n\r\n");
    const auto length = head.find("Content-Length: ") + 16;
    status = head.substr(9, 3);
    return json::parse(client.read_exactly(std::stoul(head.substr(length))));
  }
  void accept_latest(std::uint64_t emergency_id = 0) {
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, emergency_id);
    clock.settle();
  }
  // It is sent, and the robot takes it.
  void expect_sent(const json& command) {
    const std::size_t before = robot->commands().size();
    client.send(post(kCommands, command));
    ASSERT_EQ(robot->commands().size(), before + 1);
    accept_latest();
    answer();
    EXPECT_EQ(status, "200");
  }
  std::string holder() const { return station.find("r1")->control.holder; }

  RawClient client{clock, port()};
  std::string status;  // of the latest answer
};

TEST_F(StandstillTest, ACommandThatWaitedLongerThanItsLifeMovesNothingAndTakesNoControl) {
  for (const json& command : {set_duty(500), json{{"kind", "set_setpoint"}, {"setpoint_m", 0.1}, {"life_ms", 500}},
                              json{{"kind", "set_mode"}, {"mode", "auto"}, {"setpoint_m", 0.1}, {"life_ms", 500}},
                              json{{"kind", "inject_disturbance"}, {"disturbance_m", 0.1}, {"life_ms", 500}},
                              json{{"kind", "renew_lease"}, {"life_ms", 500}}}) {
    send_during(700ms, post(kCommands, command));
    EXPECT_EQ(answer()["reason"], "too_old_on_arrival") << command;
    EXPECT_EQ(status, "504");
    clock.run_for(10ms);
  }
  EXPECT_TRUE(robot->commands().empty());
  EXPECT_EQ(holder(), "");
}

TEST_F(StandstillTest, ALongerLifeCountsFromTheTurnBefore) {
  expect_sent(set_duty(500));
  EXPECT_EQ(holder(), "token:local");
  send_during(700ms, post(kCommands, set_duty(2000)));
  ASSERT_EQ(robot->commands().size(), 2U) << "that of the holder of control is";
  EXPECT_LE(robot->commands().back().valid_until_robot_us, robot->robot_now_us() + 1'300'000);
}

TEST_F(StandstillTest, ByWhatWaitedNobodyTakesControlAndNoLeaseIsRenewed) {
  send_during(700ms, post(kCommands, set_duty(10'000)));
  EXPECT_EQ(answer()["reason"], "stale");
  send_during(700ms, post("/api/v1/robots/r1/control", {{"action", "take"}}));
  EXPECT_EQ(answer()["reason"], "stale");
  EXPECT_EQ(holder(), "");
  expect_sent(set_duty(500));
  send_during(700ms, post(kCommands, {{"kind", "renew_lease"}, {"life_ms", 10'000}}));
  EXPECT_EQ(answer()["reason"], "stale");
  EXPECT_EQ(robot->commands().size(), 1U);
  send_during(700ms, post("/api/v1/robots/r1/control", {{"action", "release"}}));
  answer();
  EXPECT_EQ(status, "200") << "what gives up control is obeyed";
}

TEST_F(StandstillTest, AStopThatWaitedIsObeyed) {
  send_during(3s, post("/api/v1/robots/r1/emergency-stop", json::object()));
  ASSERT_EQ(robot->commands().size(), 1U);
  EXPECT_EQ(robot->commands()[0].which_action, rheonaut_Command_emergency_stop_tag);
}

TEST_F(StandstillTest, WhatMovesNothingKeepsItsTimeToLive) {
  expect_sent(set_duty(500));
  send_during(700ms, post(kCommands, {{"kind", "set_mode"}, {"mode", "manual"}, {"life_ms", 500}}));
  ASSERT_EQ(robot->commands().size(), 2U);
  EXPECT_EQ(robot->commands().back().which_action, rheonaut_Command_set_mode_tag);
}

TEST_F(StandstillTest, WhatIsSentAfterwardsIsFresh) {
  send_during(3s, post(kCommands, set_duty(500)));
  EXPECT_EQ(answer()["reason"], "too_old_on_arrival");
  expect_sent(set_duty(500));
}

TEST_F(StandstillTest, WhatCameBehindItIsAsOldThoughItIsReadLater) {
  const std::string ping = post(kCommands, {{"kind", "ping"}, {"life_ms", 10'000}});
  send_during(700ms, ping + post(kCommands, set_duty(500)));
  ASSERT_EQ(robot->commands().size(), 1U);
  clock.run_for(20ms);
  accept_latest();
  answer();
  EXPECT_EQ(status, "200");
  EXPECT_EQ(answer()["reason"], "too_old_on_arrival");
  EXPECT_EQ(robot->commands().size(), 1U);
}

TEST_F(StandstillTest, ACommandWhoseBeginningCameBeforeIsAsOldAsTheRest) {
  const std::string whole = post(kCommands, set_duty(500));
  client.send(whole.substr(0, whole.size() - 10));
  send_during(700ms, whole.substr(whole.size() - 10));
  EXPECT_EQ(answer()["reason"], "too_old_on_arrival");
}

TEST_F(StandstillTest, ALoopThatIsMerelyBusyRefusesNothing) {
  send_during(200ms, post(kCommands, set_duty(100)));
  EXPECT_EQ(robot->commands().size(), 1U);
  EXPECT_EQ(holder(), "token:local");
}

TEST_F(StandstillTest, APageThatSpokeBeforeKeepsNothingByIt) {
  tasks.spawn("control", station.watch_control());
  Page page{clock, port(), "Authorization: Bearer " + token() + "\r\n"};
  ASSERT_TRUE(page.open());
  expect_sent(set_duty(500));
  const auto say_during = [&](microseconds standstill, json message) {
    message["stamp_us"] = clock.steady_us();
    page.client().is_held = true;
    page.say(message);
    clock.skip(standstill);
    page.client().is_held = false;
    clock.settle();
  };
  say_during(700ms, {{"type", "renew_lease"}, {"robot_id", "r1"}});
  EXPECT_EQ(page.receive("problem")["problem"]["reason"], "stale");
  EXPECT_EQ(robot->commands().size(), 1U);
  say_during(2400ms, {{"type", "keep_alive"}});
  clock.run_for(300ms);
  EXPECT_EQ(holder(), "") << "3 s after the command";
  say_during(3s, {{"type", "emergency_stop"}, {"robot_id", "r1"}});
  EXPECT_EQ(station.find("r1")->latched(), true);
}

}  // namespace
}  // namespace server
