// SAFETY: a sign of life is of one client for one thing. Two programs with one token, and two tabs of one session, are
// two clients: the one lets nothing of the other begin, and keeps nothing of it going.
#include <functional>

#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;
using station::Client;
using storage::ExperimentId;

constexpr const char* kDutyOfAClient = "kind = \"duty\"\nduty = 0.2\nfor_s = 10";
constexpr const char* kSetpointOfAClient = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 10";

const Client kFirst{"token:local", "script-one"}, kSecond{"token:local", "script-two"}, kNameless{"token:local", ""};

class ExperimentClientsTest : public ExperimentTest {
 protected:
  explicit ExperimentClientsTest(bool allow_unattended = false) : ExperimentTest{allow_unattended} {
    begin();
    clock.run_for(4s);  // nobody has commanded the robot for so long
  }

  double duty() const { return robot->simulated().motor_duty(); }
  static station::Author author(const Client& client) { return {client.actor, "127.0.0.1", 0, client.id}; }
  ExperimentId begin_by(const Client& client, const std::string& document, bool is_unattended = false) {
    storage::ExperimentRequest request;
    request.robot_id = "sim-1";
    request.profile = document;
    request.is_unattended = is_unattended;
    const auto begun = wait_for(experiments->begin(std::move(request), author(client)));
    EXPECT_TRUE(begun) << begun.error().detail;
    return begun ? begun->experiment.id : 0;
  }
  void sign(const Client& client, ExperimentId id) { experiments->keep_alive(id, client, 20ms); }
  // Ten times a second.
  void pass(microseconds time, const std::function<void()>& signs) {
    for (microseconds passed{0}; passed < time; passed += 100ms) {
      signs();
      clock.run_for(100ms);
    }
  }
  // It runs, and the motor turns.
  ExperimentId start_by(const Client& client) {
    const ExperimentId id = begin_by(client, profile({kDutyOfAClient}));
    for (int tenth = 0; tenth < 100 && duty() == 0; ++tenth) pass(100ms, [&] { sign(client, id); });
    EXPECT_NE(duty(), 0);
    return id;
  }
};

TEST_F(ExperimentClientsTest, NobodyElsesSignsLetItBegin) {
  const ExperimentId id = begin_by(kFirst, profile({kDutyOfAClient}));
  pass(5s, [&] {
    sign(kSecond, id);
    sign(kNameless, id);
    sign({"user:ana/session:1", kFirst.id}, id);  // the id is worth nothing with another credential
    sign(kFirst, id + 1);
    station.keep_control(kFirst, "sim-1", 0us);
  });
  EXPECT_EQ(view(id).waits_for, "nobody_present");
  EXPECT_EQ(duty(), 0);
  pass(2s, [&] { sign(kFirst, id); });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
}

TEST_F(ExperimentClientsTest, WhatIsLeftAloneForAMinuteIsHeldUntilSomebodyResumesIt) {
  const ExperimentId id = begin_by(kFirst, profile({kDutyOfAClient}));
  pass(58s, [&] { sign(kSecond, id); });
  EXPECT_EQ(view(id).waits_for, "nobody_present");
  pass(3s, [&] { sign(kSecond, id); });
  EXPECT_TRUE(view(id).experiment.is_held);
  EXPECT_EQ(view(id).waits_for, "held");
  EXPECT_EQ(view(id).experiment.reason, "nobody_present");
  pass(5s, [&] { sign(kFirst, id); });
  EXPECT_EQ(duty(), 0) << "its own client has come back, and has not resumed it";
  clock.run_for(11s);
  ASSERT_TRUE(wait_for(experiments->resume(id, author(kSecond))));
  pass(3s, [&] { sign(kFirst, id); });
  EXPECT_EQ(duty(), 0) << "who resumed it has it in their hands";
  pass(3s, [&] { sign(kSecond, id); });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
}

TEST_F(ExperimentClientsTest, ItGoesOnForItsOwnClientAlone) {
  const ExperimentId id = start_by(kFirst);
  pass(500ms, [&] {
    sign(kSecond, id);
    sign(kNameless, id);
    sign(kFirst, id + 1);
  });
  pass(400ms, [&] { station.keep_control(kSecond, "sim-1", 0us); });
  EXPECT_EQ(duty(), 0) << "its last sign counts for 400 ms, a lease for 500 ms";
  expect_aborted(id, "nobody_present", 20s);
}

TEST_F(ExperimentClientsTest, WhoTakesItOverKeepsItAlone) {
  const ExperimentId id = start_by(kFirst);
  ASSERT_TRUE(wait_for(experiments->take_over(id, author(kSecond))));
  pass(5s, [&] { sign(kSecond, id); });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
  EXPECT_EQ(view(id).experiment.client, kSecond.id);
  EXPECT_NE(duty(), 0);
  pass(1s, [&] { sign(kFirst, id); });
  EXPECT_EQ(duty(), 0);
  expect_aborted(id, "nobody_present", 20s);
}

// What waits on the robot for its time is the experiment's, and goes on with it.
TEST_F(ExperimentClientsTest, WhoTakesItOverBreaksNoStepOffThatWaitsOnTheRobot) {
  std::string steps;
  for (int step = 0; step < 60; ++step) {
    steps += fmt::format("[[step]]\nkind = \"setpoint\"\nsetpoint_m = {}\nfor_s = 0.2\n", step % 2 == 0 ? 0.01 : 0.02);
  }
  const ExperimentId id = begin_by(kFirst, profile({}, "") + steps);
  pass(4s, [&] { sign(kFirst, id); });
  ASSERT_EQ(view(id).experiment.state, ExperimentState::running);
  const std::int64_t now_us = clock.steady_us();
  ASSERT_TRUE(wait_for(experiments->take_over(id, author(kSecond), now_us)));
  for (int tenth = 0; tenth < 150 && view(id).experiment.state == ExperimentState::running; ++tenth) {
    pass(100ms, [&] { sign(kSecond, id); });
  }
  EXPECT_EQ(view(id).experiment.state, ExperimentState::done) << view(id).experiment.detail;
  EXPECT_EQ(nlohmann::json::parse(view(id).experiment.runs.at(0).steps).size(), 60U) << "none was repeated";
}

// A person changes what the experiment has asked them to, by another tool.
TEST_F(ExperimentClientsTest, AParameterSetByAnotherToolChangesNoHands) {
  const ExperimentId id = start_by(kFirst);
  station::CommandRequest request;
  request.robot_id = "sim-1";
  request.action = sim_robot::set_parameter("telemetry_batch", 5);
  request.actor = kSecond.actor;
  request.client = kSecond.id;
  request.peer = "127.0.0.1";
  ASSERT_TRUE(wait_for(station.submit(std::move(request))));
  pass(2s, [&] { sign(kFirst, id); });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running) << view(id).experiment.reason;
  EXPECT_NE(duty(), 0);
}

TEST_F(ExperimentClientsTest, WhoResumesItHasControlBackFromAnotherPageOfTheActor) {
  const ExperimentId id = start_by(kFirst);
  station::ControlRequest take;
  take.robot_id = "sim-1";
  take.actor = kSecond.actor;
  take.client = kSecond.id;
  ASSERT_TRUE(station.control(take));
  pass(1s, [&] { sign(kFirst, id); });
  ASSERT_EQ(view(id).experiment.reason, "control_changed");
  ASSERT_TRUE(wait_for(experiments->resume(id, author(kFirst))));
  pass(3s, [&] {
    sign(kFirst, id);
    station.keep_control(kSecond, "sim-1", 0us);
  });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running) << view(id).experiment.reason;
  EXPECT_NE(duty(), 0);
}

TEST_F(ExperimentClientsTest, WhatAToolPerformsMayBeResumedFromAnotherTerminal) {
  const ExperimentId id = start_by(kFirst);
  ASSERT_TRUE(wait_for(experiments->pause(id, author(kSecond))));
  pass(2s, [&] { sign(kFirst, id); });
  EXPECT_EQ(duty(), 0);
  ASSERT_TRUE(wait_for(experiments->resume(id, author(kSecond))));  // and that invocation ends
  pass(3s, [&] { sign(kFirst, id); });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
  EXPECT_NE(duty(), 0);
}

// However long the disk or the worker takes until the request is carried out.
TEST_F(ExperimentClientsTest, TheSignOfARequestIsAsOldAsTheRequest) {
  storage::ExperimentRequest request;
  request.robot_id = "sim-1";
  request.profile = profile({kDutyOfAClient});
  const auto begun =
      wait_for(experiments->begin(std::move(request), author(kFirst), clock.steady_us() - 500'000)).value();
  clock.run_for(2s);
  EXPECT_EQ(view(begun.experiment.id).waits_for, "nobody_present");
  EXPECT_EQ(duty(), 0);
}

TEST_F(ExperimentClientsTest, AnotherClientOfItsActorThatTakesControlHasIt) {
  const ExperimentId id = start_by(kFirst);
  station::ControlRequest take;
  take.robot_id = "sim-1";
  take.actor = kSecond.actor;
  take.client = kSecond.id;
  ASSERT_TRUE(station.control(take));
  pass(2s, [&] {
    sign(kFirst, id);
    station.keep_control(kSecond, "sim-1", 0us);
  });
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "control_changed");
  ASSERT_TRUE(wait_for(experiments->take_over(id, author(kSecond))));
  ASSERT_TRUE(wait_for(experiments->resume(id, author(kSecond))));
  pass(3s, [&] { sign(kSecond, id); });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
  EXPECT_NE(duty(), 0);
}

class UnattendedClientsTest : public ExperimentClientsTest {
 protected:
  UnattendedClientsTest() : ExperimentClientsTest{true} {}
};

TEST_F(UnattendedClientsTest, AnUnattendedOneNeedsItsOwnClientToBeginAlone) {
  const ExperimentId id = begin_by(kFirst, profile({kSetpointOfAClient}, "unattended = true\n"), true);
  pass(5s, [&] { sign(kSecond, id); });
  EXPECT_EQ(view(id).waits_for, "nobody_present");
  pass(2s, [&] { sign(kFirst, id); });
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
  clock.run_for(8s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running) << "nobody has given a sign since";
}

// Three invocations of a tool: begun by one, paused by another, resumed by a third.
TEST_F(UnattendedClientsTest, ControlComesIntoTheHandsOfWhoResumesIt) {
  const char* const long_setpoint = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 30";
  const ExperimentId id = begin_by(kFirst, profile({long_setpoint}, "unattended = true\n"), true);
  pass(2s, [&] { sign(kFirst, id); });
  ASSERT_EQ(view(id).experiment.state, ExperimentState::running);
  clock.run_for(11s);
  ASSERT_TRUE(wait_for(experiments->pause(id, author(kNameless))));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->resume(id, author(kSecond))));
  until(id, ExperimentState::done, 90s);
  EXPECT_EQ(view(id).experiment.client, "") << "not on disk";
}

}  // namespace
}  // namespace server
