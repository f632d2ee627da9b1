// An experiment whose link, command, samples or client were late: the robot rests, and it goes on where it was broken
// off; or it does not, where it must not.
#include "server/analysis/run_recording.hpp"
#include "tests/system/interrupted_fixture.hpp"

namespace server {
namespace {

constexpr const char* kDuty = "kind = \"duty\"\nduty = 0.2\nfor_s = 8";
constexpr const char* kSetpoint = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 8";

TEST_F(InterruptedTest, ADutyGoesOnWhereALostLinkBrokeItOff) {
  const auto id = start(profile({kDuty}));
  clock.run_for(3s);
  lose_link(1400ms);
  expect_interrupted(id, "link_lost");
  clock.run_for(1500ms);
  EXPECT_NE(view(id).experiment.detail.find("the link to the robot was away for 1."), std::string::npos)
      << view(id).experiment.detail;
  EXPECT_NE(view(id).experiment.detail.find("it goes on in"), std::string::npos) << view(id).experiment.detail;
  until(id, ExperimentState::done);
  EXPECT_EQ(begins(id), 1U);
  EXPECT_NEAR(static_cast<double>(driven(id)), 800, 20);
}

// From the tick at which the motor went off to the one at which the line goes on.
TEST_F(InterruptedTest, ItIsMarkedInItsRun) {
  const auto id = start(profile({"kind = \"rest\"\nfor_s = 1", "kind = \"duty\"\nduty = 0.2\nfor_s = 12"}));
  clock.run_for(3s);
  lose_link(1400ms);
  until(id, ExperimentState::done);
  const auto samples = samples_of_first_run(id);
  const storage::Run run = run_of(id);
  ASSERT_EQ(run.interrupted.size(), 1U);
  const storage::InterruptedPart& part = run.interrupted.front();
  EXPECT_EQ(part.reason, "link_lost");
  EXPECT_NE(part.detail.find("the link to the robot was away for 1."), std::string::npos) << part.detail;
  EXPECT_EQ(part.span, 0U);
  std::size_t driven_before = 0, driven_after = 0;
  for (const storage::StoredSample& stored : samples) {
    if (stored.sample.duty == 0) continue;
    driven_before += stored.robot_time_us < part.from_robot_us ? 1 : 0;
    driven_after += stored.robot_time_us >= part.to_robot_us ? 1 : 0;
  }
  EXPECT_EQ(driven_before + driven_after, driven(id)) << "no motor in the part";
  EXPECT_GT(driven_before, 200U);
  EXPECT_GT(driven_after, 200U);
  const auto recorded = analysis::recording_of({samples, {}, run.interrupted}, {});
  ASSERT_TRUE(recorded) << recorded.error().detail;
  const auto left_out = std::ranges::count(recorded->recording.is_left_out, true);
  EXPECT_NEAR(static_cast<double>(left_out), static_cast<double>(part.to_robot_us - part.from_robot_us) / 1e4, 2);
  ASSERT_FALSE(recorded->warnings.empty());
  EXPECT_NE(recorded->warnings.front().find("(link_lost)"), std::string::npos) << recorded->warnings.front();
}

// Also where it is aborted before it goes on, and where a person paused it.
TEST_F(InterruptedTest, WhatDoesNotGoOnIsMarkedToo) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  const station::Author by{"anna", "127.0.0.1", 0};
  ASSERT_TRUE(wait_for(experiments->pause(id, by)));
  clock.run_for(20s);
  abort_aside(id);
  until(id, ExperimentState::aborted);
  const auto samples = samples_of_first_run(id);
  const storage::Run run = run_of(id);
  ASSERT_EQ(run.interrupted.size(), 1U);
  EXPECT_EQ(run.interrupted.front().reason, "requested");
  const auto recorded = analysis::recording_of({samples, {}, run.interrupted}, {});
  ASSERT_FALSE(recorded);
  EXPECT_EQ(recorded.error().reason, "too_little_usable");
  EXPECT_NE(recorded.error().detail.find("can be fitted, less than 50 %"), std::string::npos)
      << recorded.error().detail;
  analysis::RunWindow before;
  before.to_s = 2;
  EXPECT_TRUE(analysis::recording_of({samples, {}, run.interrupted}, before)) << "a part that somebody chooses";
}

TEST_F(InterruptedTest, ProgressStandsStillMeanwhile) {
  const auto id = start(profile({kDuty}));
  clock.run_for(3s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  clock.run_for(1s);
  const double elapsed_s = view(id).progress->elapsed_s;
  clock.run_for(1s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_DOUBLE_EQ(view(id).progress->elapsed_s, elapsed_s);
  until(id, ExperimentState::done);
}

TEST_F(InterruptedTest, AClosedLoopStepBeginsAgain) {
  const auto id = start(profile({kSetpoint}));
  clock.run_for(3s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  until(id, ExperimentState::done);
  EXPECT_EQ(begins(id), 2U);
}

TEST_F(InterruptedTest, ALinkThatIsSilentForAMomentIsNoEnd) {
  for (const auto silent : {600ms, 1200ms, 2500ms}) {
    const auto id = start(profile({kDuty}));
    clock.run_for(2s);
    robot->stall(true);
    clock.run_for(silent);
    robot->stall(false);
    until(id, ExperimentState::done);
    EXPECT_NEAR(static_cast<double>(driven(id)), 800, 60) << silent.count();
  }
}

TEST_F(InterruptedTest, ALinkThatStaysAwayEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  robot->redial = false;
  robot->cut();
  const auto ended = until(id, ExperimentState::aborted, 60s);
  EXPECT_EQ(ended.reason, "link_lost");
  EXPECT_EQ(duty(), 0);
}

TEST_F(InterruptedTest, ABootEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  switch_off_and_on();
  expect_aborted(id, "reboot");
}

TEST_F(InterruptedTest, AStopEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  send(sim_robot::emergency_stop());
  const auto ended = until(id, ExperimentState::aborted);
  EXPECT_EQ(ended.reason, "emergency_stop");
  clock.run_for(10s);
  EXPECT_EQ(duty(), 0);
}

TEST_F(InterruptedTest, APauseInTheCountDownHoldsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  ASSERT_TRUE(
      clock.run_until([&] { return view(id).experiment.detail.find("it goes on in") != std::string::npos; }, 5s));
  clock.run_for(1s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(20s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "requested");
  EXPECT_EQ(duty(), 0);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
  EXPECT_NEAR(static_cast<double>(driven(id)), 800, 20);
}

// SAFETY: a sign of life from before the robot was seen at rest counts for nothing.
TEST_F(InterruptedTest, NothingGoesOnForAClientWhoIsNotThere) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  leave("anna");
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  expect_aborted(id, "link_lost", 20s);
}

TEST_F(InterruptedTest, AClientThatIsBackWithinTenSecondsGoesOn) {
  const auto id = start(profile({kSetpoint}));
  clock.run_for(2s);
  leave("anna");
  ASSERT_TRUE(clock.run_until([&] { return view(id).experiment.state == ExperimentState::paused; }, 5s));
  clock.run_for(6s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  come("anna");
  clock.run_for(2s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL) << "the count-down";
  until(id, ExperimentState::done);
}

TEST_F(InterruptedTest, NothingGoesOnWhenControlWasTaken) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  come("boris");
  ASSERT_TRUE(control_by("boris", station::ControlAction::force));
  until(id, ExperimentState::aborted, 80s);
  EXPECT_EQ(station.holder("sim-1"), "boris");
  EXPECT_EQ(duty(), 0);
}

// SAFETY: and does so by itself no more when who has taken it lets it go.
TEST_F(InterruptedTest, NothingGoesOnWhenControlWasTakenAndLetGo) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  ASSERT_TRUE(control_by("boris", station::ControlAction::force));
  clock.run_for(200ms);
  ASSERT_TRUE(control_by("boris", station::ControlAction::release));
  clock.run_for(15s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "control_changed");
  EXPECT_EQ(duty(), 0);
}

TEST_F(InterruptedTest, WhoGivesControlUpEndsIt) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  ASSERT_TRUE(control_by("anna", station::ControlAction::release));
  expect_aborted(id, "control_changed");
}

TEST_F(InterruptedTest, WhoResumesItWhileTheLinkIsAwayIsAskedAgain) {
  const auto id = start(profile({kDuty}));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(1s);
  robot->redial = false;
  robot->cut();
  clock.run_for(1s);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  clock.run_for(20s);
  robot->redial = true;
  robot->dial(*listener);
  clock.run_for(10s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(duty(), 0);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
}

// With the duty that is in force where it is broken off.
TEST_F(InterruptedTest, WhatIsLeftKeepsWithinTheLimits) {
  const auto id = start(profile({"kind = \"duty\"\nduty = 0.3\nfor_s = 30"}, "[limits]\nposition_max_m = 0.4\n"));
  clock.run_for(2s);
  EXPECT_LT(robot->simulated().world().position_m(), 0.3);
  lose_link(700ms);
  expect_aborted(id, "no_room");
  EXPECT_LT(robot->simulated().world().position_m(), 0.35);
}

// A run that may go back to 0 by itself makes room so.
class WayBackTest : public InterruptedTest {
 protected:
  // Interrupted where the rest of it would leave the limits, and on its way back.
  void go_back() {
    id = start(profile({"kind = \"duty\"\nduty = 0.3\nfor_s = 10"},
                       "[conditions]\nstart = \"back\"\n[limits]\nposition_max_m = 0.26\n"));
    clock.run_for(5s);
    lose_link(700ms);
    expect_interrupted(id, "link_lost");
    from_m = position_m();
    ASSERT_TRUE(clock.run_until([&] { return position_m() < from_m - 0.02; }, 15s)) << detail();
    EXPECT_EQ(state().context.mode, rheonaut_MODE_AUTO);
    EXPECT_EQ(view(id).experiment.state, ExperimentState::running) << "it moves";
    EXPECT_NE(detail().find("it goes back to 0"), std::string::npos) << detail();
  }
  double position_m() const { return robot->simulated().world().position_m(); }
  std::string detail() { return view(id).experiment.detail; }

  storage::ExperimentId id = 0;
  double from_m = 0;
};

TEST_F(WayBackTest, MakesRoomForWhatIsLeft) {
  go_back();
  until(id, ExperimentState::done, 90s);
  double furthest_m = 0;
  for (const auto& one : samples_of_first_run(id)) furthest_m = std::max(furthest_m, double{one.sample.position_m});
  EXPECT_LT(furthest_m, 0.26);
  EXPECT_EQ(begins(id), 1U);
  const storage::Run run = run_of(id);
  ASSERT_EQ(run.interrupted.size(), 1U);
  EXPECT_GT(run.interrupted.front().to_robot_us - run.interrupted.front().from_robot_us, 15'000'000U)
      << "the way is no part of the line";
}

TEST_F(WayBackTest, ComesToRestWhenItIsPaused) {
  go_back();
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  ASSERT_TRUE(clock.run_until([&] { return duty() == 0; }, 1s));
  clock.run_for(20s);
  EXPECT_EQ(duty(), 0);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done, 90s);
}

// SAFETY: what is late in the same moment takes the pause not away.
TEST_F(WayBackTest, APauseHoldsAlsoWhereSomethingIsLateMeanwhile) {
  go_back();
  robot->redial = false;
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  robot->cut();
  leave("anna");
  clock.run_for(3s);
  robot->redial = true;
  robot->dial(*listener);
  come("anna");
  clock.run_for(20s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "requested") << detail();
  EXPECT_EQ(duty(), 0);
}

TEST_F(WayBackTest, IsInterruptedLikeAStep) {
  go_back();
  lose_link(700ms);
  ASSERT_TRUE(clock.run_until([&] { return duty() == 0 && state().context.mode == rheonaut_MODE_MANUAL; }, 2s));
  until(id, ExperimentState::done, 90s);
  EXPECT_EQ(begins(id), 1U);
}

TEST_F(WayBackTest, EndsWithItsClientsSignsOfLife) {
  go_back();
  leave("anna");
  ASSERT_TRUE(clock.run_until([&] { return state().context.mode == rheonaut_MODE_MANUAL; }, 4s));
  expect_aborted(id, "nobody_present", 20s);
  EXPECT_EQ(duty(), 0);
}

TEST_F(InterruptedTest, AClosedLoopStepBeginsFiveTimes) {
  const auto id = start(profile({"kind = \"setpoint\"\nsetpoint_m = 0.05\nfor_s = 60"}));
  for (int begun = 1; begun < 5; ++begun) {
    clock.run_for(2s);
    lose_link(300ms);
    expect_interrupted(id, "link_lost");
    until(id, ExperimentState::running, 20s);
  }
  clock.run_for(2s);
  lose_link(300ms);
  expect_aborted(id, "too_many_repeats", 20s);
}

TEST_F(InterruptedTest, InterruptionsLastNoLongerThanTheRun) {
  const auto id = start(profile({"kind = \"duty\"\nduty = 0.1\nfor_s = 9"}));
  for (int k = 0; k < 3 && view(id).experiment.state == ExperimentState::running; ++k) {
    clock.run_for(1s);
    lose_link(5s);
    clock.run_for(6s);
  }
  expect_aborted(id, "too_many_repeats", 20s);
}

TEST_F(InterruptedTest, BeforeARunItWaitsForTheLink) {
  come("anna");
  const auto id = enqueue(profile({kDuty}, "[sweep]\nrepeats = 2\n"));
  until(id, ExperimentState::running);
  lose_link(1500ms);  // it is being prepared
  until(id, ExperimentState::done, 120s);
}

// Ten outages of 0.2 to 3 s at any moment of the profile that a fit needs: deploy says how many seeds.
}  // namespace
}  // namespace server
