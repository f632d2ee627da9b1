// SAFETY: what a right that ends leaves alone, and how a robot that moves in its name comes to rest: also one that is
// away.
#include "tests/system/ended_rights_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;

TEST_F(EndedRightsTest, SomebodyElseWhoHasTakenControlGoesOn) {
  const std::string first = token(), second = token();
  send(first, sim_robot::set_auto(0.1F));
  ASSERT_TRUE(control_by(first, station::ControlAction::release));
  send(second, sim_robot::set_setpoint(0.12F));
  ASSERT_TRUE(wait_for(accounts.revoke_token(first.substr(6), admin())));
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO);
  EXPECT_EQ(station.holder("sim-1"), second) << "by its lease of 3 s";
}

TEST_F(EndedRightsTest, WhatTheyHaveAskedForIsHandedToNobody) {
  const std::string first = token(), second = token();
  ASSERT_TRUE(control_by(first, station::ControlAction::take));
  ASSERT_TRUE(control_by(second, station::ControlAction::request));
  ASSERT_TRUE(wait_for(accounts.revoke_token(second.substr(6), admin())));
  EXPECT_FALSE(control_by(first, station::ControlAction::hand_over));
  EXPECT_EQ(station.holder("sim-1"), first);
}

TEST_F(EndedRightsTest, SomebodyElseWhoTakesTheRobotAtOnceIsNotStopped) {
  const std::string first = token(), second = token();
  send(first, sim_robot::set_auto(0.1F));
  ASSERT_TRUE(wait_for(accounts.revoke_token(first.substr(6), admin())));
  clock.run_for(50ms);  // the order to rest is accepted, and who gave it looks again in 200 ms
  send(second, sim_robot::set_auto(0.12F));
  come(second);
  clock.run_for(6s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO);
}

TEST_F(EndedRightsTest, ARobotThatRestsIsToldNothing) {
  const std::string actor = token();
  send(actor, sim_robot::set_auto(0.1F));
  send(actor, sim_robot::set_manual());
  clock.run_for(4s);
  const std::size_t told = sink.commands.size();
  ASSERT_TRUE(wait_for(accounts.revoke_token(actor.substr(6), admin())));
  clock.run_for(2s);
  EXPECT_EQ(sink.commands.size(), told);
}

TEST_F(EndedRightsTest, AnotherBootMovesForWhoControlsIt) {
  const std::string actor = token();
  come(actor);
  send(actor, sim_robot::set_auto(0.1F));
  ASSERT_TRUE(control_by(actor, station::ControlAction::take));
  switch_off_and_on();
  if (state().latched()) send(actor, sim_robot::clear_emergency(state().context.emergency_id));
  send(actor, sim_robot::set_auto(0.1F));
  ASSERT_FALSE(is_at_rest());
  ASSERT_TRUE(wait_for(accounts.revoke_token(actor.substr(6), admin())));
  clock.run_for(200ms);
  EXPECT_TRUE(is_at_rest());
}

// As of one that ended while the station was down, or in the middle of something.
TEST_F(EndedRightsTest, ARightThatIsNotThereIsFoundWithinASecond) {
  send("token:of-before", sim_robot::set_auto(0.1F));
  const auto waiting = begin_by("user:nobody/session:1", "kind = \"duty\"\nduty = 0.2\nfor_s = 30");
  clock.run_for(1200ms);
  EXPECT_TRUE(is_at_rest());
  EXPECT_EQ(station.holder("sim-1"), "");
  EXPECT_EQ(view(waiting).experiment.state, ExperimentState::cancelled);
}

TEST_F(EndedRightsTest, AClockThatWasAheadForAMomentTakesNoRealExpiryAway) {
  const std::string actor = token("", 1);
  clock.step_utc(25h);
  clock.run_for(2s);
  clock.step_utc(-25h);
  clock.run_for(2s);
  send(actor, sim_robot::set_auto(0.1F));
  clock.step_utc(left_of_token() + 1s);
  clock.run_for(2s);
  EXPECT_TRUE(is_at_rest());
}

// A sink that fails when a right ends.
class FailsAtTheEnd final : public station::StationSink {
 public:
  void on_right_ended(const runtime::EndedRight&) override { throw std::runtime_error{"a fault"}; }
};

TEST_F(EndedRightsTest, APartThatFailsKeepsNoRobotMoving) {
  const std::string actor = token();
  static FailsAtTheEnd fails;  // it outlives the station
  station.add_sink(fails);
  send(actor, sim_robot::set_auto(0.1F));
  ASSERT_TRUE(wait_for(accounts.revoke_token(actor.substr(6), admin())));
  clock.run_for(200ms);
  EXPECT_TRUE(is_at_rest());
}

// --- no stop, kept or not, and no way to rest ends with a right ---

TEST_F(EndedRightsTest, AStopAndAKeptStopStay) {
  const std::string actor = token();
  const auto stop = [&] {
    station::StopRequest request;
    request.robot_id = "sim-1";
    request.actor = actor;
    return wait_for(station.emergency_stop(std::move(request), 1s));
  };
  send(actor, sim_robot::set_auto(0.1F));
  robot->redial = false;
  robot->cut();
  clock.run_for(100ms);
  ASSERT_TRUE(stop());
  ASSERT_TRUE(wait_for(accounts.revoke_token(actor.substr(6), admin())));
  robot->dial(*listener);
  ASSERT_TRUE(clock.run_until([&] { return state().context.mode == rheonaut_MODE_EMERGENCY; }, 2s));
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_EMERGENCY);
}

TEST_F(EndedRightsTest, ARobotThatIsAwayComesToRestFirstOfAllWhenItIsBack) {
  const std::string actor = token();
  send(actor, sim_robot::set_auto(0.1F));
  robot->redial = false;
  robot->cut();
  clock.run_for(100ms);
  ASSERT_TRUE(wait_for(accounts.revoke_token(actor.substr(6), admin())));
  clock.run_for(500ms);
  const std::size_t told = sink.commands.size();
  robot->dial(*listener);
  ASSERT_TRUE(clock.run_until([&] { return sink.commands.size() > told; }, 2s));
  EXPECT_EQ(sink.commands.at(told).kind, "set_mode");
  EXPECT_EQ(sink.commands.at(told).actor, kStationActor);
  clock.run_for(500ms);
  EXPECT_TRUE(is_at_rest());
  clock.run_for(1s);
  EXPECT_TRUE(owed().empty()) << "it was seen at rest";
}

TEST_F(EndedRightsTest, TheRestThatIsOwedSurvivesARestart) {
  const std::string actor = token();
  send(actor, sim_robot::set_auto(0.1F));
  clock.run_for(4s);  // nobody is in control any more
  owe(state().boot_id);
  robot->redial = false;
  robot->cut();
  clock.run_for(100ms);
  begin_again();  // it finds what an earlier start has left
  robot->dial(*listener);
  clock.run_for(1s);
  EXPECT_TRUE(is_at_rest());
  EXPECT_TRUE(owed().empty());
}

TEST_F(EndedRightsTest, ABootThatIsOverIsOwedNothing) {
  owe(state().boot_id + 1);
  send("token:local", sim_robot::set_auto(0.1F));
  begin_again();
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO);
  EXPECT_TRUE(owed().empty());
}

TEST_F(EndedRightsTest, NorIsARobotThatSomebodyElseControls) {
  send("token:local", sim_robot::set_auto(0.1F));
  owe(state().boot_id);
  begin_again();
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO);
  EXPECT_TRUE(owed().empty());
}

// --- a model on its way ---

TEST_F(EndedRightsTest, AModelOnItsWayIsTakenBackInNobodysName) {
  station::FluidModel model;
  model.gain_m_s = {0.1F, 0.2F / 3, -0.05F, 0.01F};
  model.time_constant_s = {0.1F, 1.0F / 3, 3, 12};
  model.fit_error = 0.001;
  ASSERT_TRUE(wait_for(recording->fluid_models.set("water", model, admin())));
  const std::string actor = token();
  ASSERT_TRUE(station.set_fluid("sim-1", "water", by(actor)));
  ASSERT_TRUE(clock.run_until([&] { return told_by(actor) >= 3; }, 5s));
  ASSERT_TRUE(wait_for(accounts.revoke_token(actor.substr(6), admin())));
  const std::ptrdiff_t told = told_by(actor);
  clock.run_for(10s);
  EXPECT_EQ(told_by(actor), told);
  EXPECT_NE(state().model.state, station::ModelState::confirmed);
  EXPECT_NE(state().model.state, station::ModelState::sending) << state().model.reason;
  EXPECT_EQ(state().context.flags & rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED, 0U);
}

// --- while a request is on its way ---

TEST_F(EndedRightsTest, AnExperimentThatIsBeingStoredBeginsNot) {
  request_behind_work(profile({"kind = \"duty\"\nduty = 0.2\nfor_s = 30"}));  // by anna
  loop.poll();
  runtime::EndedRight right{[](const std::string& actor) { return actor == "anna"; }, "a test"};
  station.end_right(right);
  let_worker_go(false);
  ASSERT_FALSE(*answered);
  EXPECT_EQ(answered->error().code, ErrorCode::forbidden);
  come("anna");
  clock.run_for(6s);
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(view(1).experiment.state, ExperimentState::cancelled);
}

}  // namespace
}  // namespace server
