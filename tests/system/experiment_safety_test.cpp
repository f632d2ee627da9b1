// SAFETY: an experiment moves a robot only for somebody who is there and in control, and leaves it at rest. Each test
// breaks one of the things that this rests on.
#include "server/storage/experiments/experiment_store.hpp"
#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;

constexpr const char* kLongDuty = "kind = \"duty\"\nduty = 0.2\nfor_s = 10";
constexpr const char* kLongSetpoint = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 10";
constexpr const char* kLater = "kind = \"disturbance\"\ndisturbance_m = 0.02\nfor_s = 3";

class ExperimentSafetyTest : public ExperimentTest {
 protected:
  explicit ExperimentSafetyTest(bool allow_unattended = false) : ExperimentTest{allow_unattended} { begin(); }
  double duty() const { return robot->simulated().motor_duty(); }
};

TEST_F(ExperimentSafetyTest, NothingBeginsWithoutSomebodyWhoIsThere) {
  const auto id = enqueue(profile({kLongDuty}));
  clock.run_for(5s);
  EXPECT_EQ(view(id).waits_for, "nobody_present");
  come("boris");  // somebody else
  clock.run_for(5s);
  EXPECT_EQ(view(id).waits_for, "nobody_present");
  EXPECT_EQ(duty(), 0);
  come("anna");
  until(id, ExperimentState::running);
}

TEST_F(ExperimentSafetyTest, WithoutSignsOfLifeTheMotorStopsAndThePageThatComesBackGoesOn) {
  const auto id = start(profile({kLongDuty}));
  ASSERT_TRUE(clock.run_until([&] { return duty() != 0; }, 5s));
  clock.run_for(1s);
  leave("anna");
  const std::int64_t left_at_us = clock.steady_us();
  ASSERT_TRUE(clock.run_until([&] { return duty() == 0; }, 2s));
  EXPECT_LE(clock.steady_us() - left_at_us, 900'000) << "its last sign counts for 400 ms, a lease for 500 ms";
  clock.run_for(1s);
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(view(id).experiment.reason, "nobody_present");
  come("anna");
  clock.run_for(2800ms);
  EXPECT_EQ(duty(), 0) << "it counts down";
  ASSERT_TRUE(clock.run_until([&] { return duty() != 0; }, 3s));
  until(id, ExperimentState::done);
  EXPECT_EQ(nlohmann::json::parse(view(id).experiment.runs.at(0).steps).size(), 1U);
}

TEST_F(ExperimentSafetyTest, WhoStaysAwayEndsIt) {
  const auto id = start(profile({kLongDuty}));
  clock.run_for(1s);
  leave("anna");
  expect_aborted(id, "nobody_present", 20s);
}

TEST_F(ExperimentSafetyTest, InAutoTooWhoStaysAwayEndsIt) {
  const auto id = start(profile({kLongSetpoint, kLater}));
  clock.run_for(1s);
  leave("anna");
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO) << "a page that is loaded again";
  expect_aborted(id, "nobody_present", 20s);
}

TEST_F(ExperimentSafetyTest, ADutyDoesNotBeginWhileNobodyIsThere) {
  const auto id = start(profile({"kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 3", kLongDuty}));
  clock.run_for(2s);
  leave("anna");
  clock.run_for(1500ms);
  EXPECT_EQ(duty(), 0);
  expect_aborted(id, "nobody_present", 20s);
}

TEST_F(ExperimentSafetyTest, AStopBetweenItsRequestAndItsPlaceInTheQueueHoldsIt) {
  come("anna");
  request_behind_work(profile({kLongDuty}));
  send(sim_robot::emergency_stop());
  loop.restart();
  loop.poll();
  let_worker_go();
  clock.run_for(1s);
  ASSERT_TRUE(command_by("anna", sim_robot::clear_emergency(state().context.emergency_id)));
  clock.run_for(8s);
  EXPECT_EQ(view((*answered)->experiment.id).waits_for, "held");
  EXPECT_EQ(duty(), 0);
}

TEST_F(ExperimentSafetyTest, APauseBeforeItMovesKeepsItFromMoving) {
  come("anna");
  const auto id = enqueue(profile({kLongSetpoint}));
  ASSERT_TRUE(clock.run_until([&] { return view(id).experiment.state == ExperimentState::running; }, 5s));
  ASSERT_FALSE(view(id).progress) << "it is being prepared";
  ASSERT_TRUE(wait_for(experiments->pause(id, {"boris", "", 0})));
  clock.run_for(5s);
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "requested");
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
}

TEST_F(ExperimentSafetyTest, APauseAtTheEndOfARunHoldsTheNextOne) {
  const char* kShort = "kind = \"duty\"\nduty = 0.2\nfor_s = 2";
  const auto id = start(profile({kShort}, "[sweep]\nrepeats = 2\n"));
  ASSERT_TRUE(clock.run_until([&] { return duty() != 0; }, 5s));
  ASSERT_TRUE(clock.run_until([&] { return duty() == 0; }, 5s));
  const auto rest = [&] { return view(id).progress && view(id).progress->elapsed_s >= 2; };
  ASSERT_TRUE(clock.run_until(rest, 1s)) << "the line is over, and the robot is brought to rest";
  ASSERT_TRUE(wait_for(experiments->pause(id, {"boris", "", 0})));
  clock.run_for(8s);
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "requested");
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(view(id).experiment.runs.size(), 1U) << "the next one has not begun";
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
}

// Its ticks are those of another length: a profile would play slower or faster, and its lease end too late.
TEST_F(ExperimentSafetyTest, ARobotWithAnotherSamplePeriodIsNotMoved) {
  const auto id = enqueue(profile({kLongDuty}));
  const_cast<station::RobotState&>(state()).sample_period_us = 20'000;
  come("anna");
  clock.run_for(8s);
  EXPECT_EQ(view(id).waits_for, "sample_period");
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(try_to_begin(profile({kLongDuty})).error().reason, "sample_period") << "it would wait for ever";
}

TEST_F(ExperimentSafetyTest, APersonsPauseOutlivesThatOfAnAbsentPage) {
  const auto id = start(profile({kLongDuty}));
  clock.run_for(1s);
  leave("anna");
  until(id, ExperimentState::paused, 2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"boris", "", 0})));
  come("anna");
  clock.run_for(3s);
  EXPECT_EQ(duty(), 0) << "it does not go on by itself";
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
}

TEST_F(ExperimentSafetyTest, AutoIsNotEnteredForSomebodyWhoHasGone) {
  const auto id = start(profile({"kind = \"rest\"\nfor_s = 2", kLongSetpoint}));
  clock.run_for(500ms);
  leave("anna");
  expect_aborted(id, "nobody_present", 20s);
  for (const auto& one : samples_of_first_run(id)) ASSERT_EQ(one.mode, rheonaut_MODE_MANUAL);
}

TEST_F(ExperimentSafetyTest, ARebootBetweenPreparationAndMotionEndsIt) {
  come("anna");
  const auto id = enqueue(profile({kLongSetpoint}));
  ASSERT_TRUE(clock.run_until([&] { return view(id).experiment.state == ExperimentState::running; }, 5s));
  switch_off_and_on();
  expect_aborted(id, "reboot");
  EXPECT_EQ(runs->any_open(), false) << "no run stays open";
}

TEST_F(ExperimentSafetyTest, AStopHoldsWhatWaitsAlsoWhenNothingRuns) {
  const auto id = enqueue(profile({kLongDuty}));
  send(sim_robot::emergency_stop());
  clock.run_for(1s);
  const auto cleared = command_by("anna", sim_robot::clear_emergency(state().context.emergency_id));
  ASSERT_TRUE(cleared);
  come("anna");
  clock.run_for(8s);
  EXPECT_EQ(view(id).waits_for, "held");
  EXPECT_EQ(duty(), 0);
}

TEST_F(ExperimentSafetyTest, NothingBeginsTheMomentThatSomebodyLetsGo) {
  come("anna");
  ASSERT_TRUE(command_by("anna", sim_robot::set_duty(0.2F)));
  const auto id = enqueue(profile({kLongDuty}));
  ASSERT_TRUE(command_by("anna", sim_robot::set_duty(0)));
  clock.run_for(2s);
  EXPECT_EQ(view(id).waits_for, "robot_in_use");
  EXPECT_EQ(duty(), 0);
  until(id, ExperimentState::running);
}

TEST_F(ExperimentSafetyTest, AnEmergencyStopEndsItAndTheQueueIsHeld) {
  const auto id = start(profile({kLongSetpoint, kLater}));
  const auto next = enqueue(profile({kLongDuty}));
  clock.run_for(1s);
  send(sim_robot::emergency_stop());
  const storage::Experiment ended = until(id, ExperimentState::aborted);
  EXPECT_EQ(ended.reason, "emergency_stop") << ended.detail;
  clock.run_for(5s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(view(next).waits_for, "held");
  const auto cleared = command_by("anna", sim_robot::clear_emergency(state().context.emergency_id));
  ASSERT_TRUE(cleared);
  clock.run_for(5s);
  EXPECT_EQ(duty(), 0) << "nothing begins by itself";
}

TEST_F(ExperimentSafetyTest, ACommandOfItsOwnOperatorEndsIt) {
  const auto id = start(profile({kLongSetpoint, kLater}));
  clock.run_for(1s);
  ASSERT_TRUE(command_by("anna", sim_robot::set_setpoint(0.05F)));
  expect_aborted(id, "operator_command");
}

TEST_F(ExperimentSafetyTest, WhoDropsWhatWaitsOnTheRobotEndsIt) {
  const auto id = start(profile({kLongSetpoint, kLater}));
  ASSERT_TRUE(clock.run_until([&] { return view(id).progress && view(id).progress->elapsed_s > 9.75; }, 20s));
  ASSERT_EQ(state().context.mode, rheonaut_MODE_AUTO);
  ASSERT_TRUE(command_by("anna", sim_robot::drop_timed())) << "the disturbance waits on the robot";
  expect_aborted(id, "operator_command");
  for (const auto& one : samples_of_first_run(id)) ASSERT_EQ(one.disturbance_m, 0.0F);
}

TEST_F(ExperimentSafetyTest, WhoTakesControlByForceHasTheRobotAtRestAndMayGoOn) {
  const auto id = start(profile({kLongDuty}));
  clock.run_for(1s);
  come("boris");
  ASSERT_TRUE(control_by("boris", station::ControlAction::force));
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "control_changed");
  clock.run_for(1s);
  EXPECT_EQ(duty(), 0);
  ASSERT_FALSE(wait_for(experiments->take_over(id, {"carla", "", 0})));
  ASSERT_TRUE(wait_for(experiments->take_over(id, {"boris", "", 0})));
  ASSERT_TRUE(wait_for(experiments->resume(id, {"boris", "", 0})));
  leave("anna");
  ASSERT_TRUE(clock.run_until([&] { return duty() != 0; }, 3s));
  const storage::Experiment ended = until(id, ExperimentState::done);
  EXPECT_EQ(ended.acts_for, "boris");
  EXPECT_EQ(ended.owner, "anna");
}

TEST_F(ExperimentSafetyTest, ControlThatWasTakenIsNotTakenBack) {
  const auto id = start(profile({kLongDuty}));
  clock.run_for(1s);
  come("boris");
  ASSERT_TRUE(control_by("boris", station::ControlAction::force));
  until(id, ExperimentState::paused);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  clock.run_for(5s);
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(station.holder("sim-1"), "boris");
  expect_aborted(id, "control_changed", 70s);
  EXPECT_EQ(station.holder("sim-1"), "boris");
}

TEST_F(ExperimentSafetyTest, ARobotThatCannotBeReachedIsStoppedWhenItIsBack) {
  const auto id = start(profile({kLongSetpoint, kLater}));
  clock.run_for(1s);
  robot->redial = false;
  robot->cut();
  const storage::Experiment ended = until(id, ExperimentState::aborted, 60s);
  EXPECT_EQ(ended.reason, "link_lost");
  EXPECT_TRUE(state().pending_stop) << "the stop is kept";
  EXPECT_EQ(duty(), 0) << "by its own rule";
}

TEST_F(ExperimentSafetyTest, OnASilentLinkTheMotorStops) {
  const auto id = start(profile({kLongDuty}));
  clock.run_for(1s);
  robot->stall(true);
  clock.run_for(1500ms);
  EXPECT_EQ(duty(), 0);
  robot->stall(false);
  until(id, ExperimentState::done);
}

TEST_F(ExperimentSafetyTest, TheAbortCriteriaOfTheProfileEndIt) {
  const auto id = start(profile({kLongSetpoint}, "[abort]\nposition_max_m = 0.06\n"));
  expect_aborted(id, "position");
  EXPECT_LT(robot->simulated().world().position_m(), 0.1);
}

TEST_F(ExperimentSafetyTest, AfterARestartWhatRanIsInterruptedWhatWaitedIsHeldAndTheRobotIsAtRest) {
  come("anna");
  storage::Experiment ran;  // as a station that was killed has left it
  ran.request.robot_id = "sim-1";
  ran.request.profile = profile({kLongSetpoint});
  ran.owner = ran.acts_for = "anna";
  storage::Experiment waited = ran;
  auto leave_behind = [&ran, &waited](storage::Database& database) {
    storage::add_experiment(database, ran, {});
    ran.state = ExperimentState::running;
    storage::store_experiment(database, ran);
    storage::add_experiment(database, waited, {});
    return true;
  };
  wait_for(recorder->on_disk(leave_behind));
  ASSERT_TRUE(command_by("anna", sim_robot::set_auto(0.1F)));
  leave("anna");
  clock.run_for(4s);
  ASSERT_EQ(state().context.mode, rheonaut_MODE_AUTO);
  robot->redial = false;  // the station is killed twice before the robot is back
  robot->cut();
  begin_again();
  clock.run_for(200ms);
  begin_again();
  robot->dial(*listener);
  EXPECT_EQ(view(ran.id).experiment.state, ExperimentState::interrupted);
  EXPECT_EQ(view(ran.id).experiment.reason, "station_restarted");
  EXPECT_TRUE(view(waited.id).experiment.is_held);
  EXPECT_TRUE(clock.run_until([&] { return state().context.mode == rheonaut_MODE_MANUAL; }, 5s));
  come("anna");
  clock.run_for(5s);
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(view(waited.id).waits_for, "held");
  ASSERT_TRUE(wait_for(experiments->resume(waited.id, {"anna", "", 0})));
  until(waited.id, ExperimentState::running);
}

class UnattendedTest : public ExperimentSafetyTest {
 protected:
  UnattendedTest() : ExperimentSafetyTest{true} {}
};

const char* kAlone = "unattended = true\n";

TEST_F(ExperimentSafetyTest, UnattendedNeedsTheAdministratorAndTheProfile) {
  const auto refused = try_to_begin(profile({kLongSetpoint}, kAlone), "anna", true);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::forbidden);
}

TEST_F(UnattendedTest, TheProfileMustSayIt) {
  EXPECT_EQ(try_to_begin(profile({kLongSetpoint}), "anna", true).error().reason, "unattended_not_allowed");
  EXPECT_FALSE(try_to_begin(profile({kLongDuty}, kAlone), "anna", true)) << "no duty without somebody there";
}

TEST_F(UnattendedTest, GoesOnWhileNobodyIsThere) {
  come("anna");
  const auto begun = try_to_begin(profile({kLongSetpoint, kLater}, kAlone), "anna", true);
  ASSERT_TRUE(begun);
  until(begun->experiment.id, ExperimentState::running);
  leave("anna");
  until(begun->experiment.id, ExperimentState::done);
  EXPECT_EQ(station.holder("sim-1"), "") << "control is given back";
}

TEST_F(UnattendedTest, EndsAtTheLimitOfTheRobot) {
  come("anna");
  ASSERT_TRUE(command_by("anna", sim_robot::set_parameter("auto_limit_s", 20)));
  clock.run_for(1s);
  const std::string head = std::string{kAlone} + "[sweep]\nrepeats = 5\n";
  const auto begun = try_to_begin(profile({kLongSetpoint}, head), "anna", true);
  ASSERT_TRUE(begun) << begun.error().detail;
  until(begun->experiment.id, ExperimentState::running);
  leave("anna");
  expect_aborted(begun->experiment.id, "unattended_limit");
}

}  // namespace
}  // namespace server
