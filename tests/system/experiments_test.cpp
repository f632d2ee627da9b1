// Experiments on a real robot core: exact times, recorded duties, the queue of a robot, what people do with them.
#include "tests/robot_fw/controllers.hpp"
#include "tests/system/experiment_fixture.hpp"

#include "server/experiments/profile_document.hpp"

namespace server {
namespace {

using namespace server::experiments;

constexpr const char* kSetpoint = "kind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 3";
constexpr const char* kDisturbance = "kind = \"disturbance\"\ndisturbance_m = -0.05\nfor_s = 2";
constexpr const char* kDuty = "kind = \"duty\"\nduty = 0.3\nfor_s = 3";
constexpr const char* kRest = "kind = \"rest\"\nfor_s = 1";

class ExperimentsTest : public ExperimentTest {
 protected:
  ExperimentsTest() { begin(); }
};

TEST_F(ExperimentsTest, EachStepBeginsInItsTickOfTheRobot) {
  const auto id = start(profile({kSetpoint, kDisturbance}));
  until(id, ExperimentState::done);
  const auto samples = samples_of_first_run(id);
  std::optional<std::size_t> setpoint, disturbance;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!setpoint && samples[i].mode == rheonaut_MODE_AUTO) setpoint = i;
    if (!disturbance && samples[i].disturbance_m != 0.0F) disturbance = i;
  }
  ASSERT_TRUE(setpoint && disturbance);
  EXPECT_EQ(*disturbance - *setpoint, 300U);
  const storage::ExperimentRun run = view(id).experiment.runs.at(0);
  const auto steps = nlohmann::json::parse(run.steps);
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[1]["kind"], "disturbance");
  EXPECT_LT(samples[*setpoint].robot_time_us - steps[0]["robot_time_us"].get<std::uint64_t>(), 10'000U);
  EXPECT_TRUE(run.has_prediction);
  const auto recorded = wait_for(runs->find(*run.run)).value();
  EXPECT_EQ(recorded.conditions.verdict, "done");
  EXPECT_EQ(recorded.samples_lost, 0U);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
}

TEST_F(ExperimentsTest, ARunBeginsBehindItsZero) {
  const auto id = start(profile({kSetpoint}));
  until(id, ExperimentState::done);
  const auto zeroed = std::ranges::find(events(), "position_zeroed", &sim_robot::ReceivedEvent::kind);
  ASSERT_NE(zeroed, events().end());
  const auto samples = samples_of_first_run(id);
  EXPECT_GE(1e-6 * static_cast<double>(samples.front().robot_time_us), zeroed->robot_time_s - 1e-9);
}

TEST_F(ExperimentsTest, TheRobotDoesEveryTickOfASignal) {
  const char* chirp = "kind = \"chirp\"\namplitude = 0.4\nfrom_hz = 0.3\nto_hz = 3\nfor_s = 12";
  const std::string document = profile({kRest, chirp, kRest});
  const auto id = start(document);
  until(id, ExperimentState::done);
  const TimeLine line = time_line_of(parse_profile(document, "test"), {});
  const auto samples = samples_of_first_run(id);
  const auto first = std::ranges::find_if(samples, [](const auto& one) { return one.sample.duty != 0; });
  const auto action = std::ranges::find_if(line.actions, [](const Action& one) { return one.value != 0; });
  ASSERT_NE(first, samples.end());
  std::size_t next = static_cast<std::size_t>(action - line.actions.begin());
  float wanted = 0;
  for (std::uint64_t tick = action->tick; tick < line.ticks; ++tick) {
    for (; next < line.actions.size() && line.actions[next].tick <= tick; ++next) {
      wanted = static_cast<float>(line.actions[next].value);
    }
    const auto at = first + static_cast<std::ptrdiff_t>(tick - action->tick);
    ASSERT_LT(at, samples.end());
    ASSERT_EQ(at->sample.duty, wanted) << "tick " << tick;
  }
}

TEST_F(ExperimentsTest, DutiesAndSetpointsFollowEachOther) {
  const char* scan = "kind = \"scan\"\nsetpoint_m = 0\nvelocity_m_s = 0.05";
  const auto id = start(profile({kDuty, kSetpoint, scan, kRest, kDuty}));
  until(id, ExperimentState::done);
  EXPECT_EQ(nlohmann::json::parse(view(id).experiment.runs.at(0).steps).size(), 5U);
}

TEST_F(ExperimentsTest, AGridIsRunOneAfterAnotherAndGoesBackBetween) {
  const std::string head = "[conditions]\nstart = \"back\"\n[sweep]\nsetpoint_factor = [1, 0.5]\nrepeats = 2\n";
  const auto id = start(profile({kSetpoint}, head));
  const storage::Experiment ended = until(id, ExperimentState::done, 200s);
  ASSERT_EQ(ended.runs.size(), 4U);
  const auto samples = samples_of(*ended.runs[3].run);
  EXPECT_NEAR(samples.front().sample.position_m, 0, 0.004) << "it went back";
  const auto setpoint = std::ranges::find_if(samples, [](const auto& one) { return one.setpoint_m.has_value(); });
  ASSERT_NE(setpoint, samples.end());
  EXPECT_FLOAT_EQ(*setpoint->setpoint_m, 0.05F);
  EXPECT_EQ(wait_for(runs->find(*ended.runs[3].run))->conditions.name, "of a test (4 of 4)");
}

TEST_F(ExperimentsTest, OthersAreRefusedWhileItRuns) {
  const auto id = start(profile({kSetpoint, kDisturbance}));
  const auto refused = command_by("boris", sim_robot::set_setpoint(0.2F));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, "not_in_control");
  until(id, ExperimentState::done);
}

TEST_F(ExperimentsTest, PausedAndResumedItGoesOnWhereItWas) {
  const auto id = start(profile({kRest, kDuty}));
  clock.run_for(1500ms);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"boris", "", 0})));
  clock.run_for(1s);
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "requested");
  EXPECT_EQ(wait_for(experiments->resume(id, {"boris", "", 0})).error().reason, "acts_for_another");
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
  const auto steps = nlohmann::json::parse(view(id).experiment.runs.at(0).steps);
  ASSERT_EQ(steps.size(), 2U) << steps;
  std::size_t driven = 0;
  for (const auto& one : samples_of_first_run(id)) driven += one.sample.duty != 0 ? 1U : 0U;
  EXPECT_NEAR(static_cast<double>(driven), 300, 5);
}

TEST_F(ExperimentsTest, TheHighestPriorityBeginsFirstAndAnAbortHoldsTheQueue) {
  come("anna");
  const auto running = start(profile({kSetpoint}));
  const auto second = enqueue(profile({kSetpoint}));
  const auto third = enqueue(profile({kRest}));
  ASSERT_TRUE(wait_for(experiments->move(third, second, 0, {"anna", "", 0})));
  until(running, ExperimentState::done);
  until(third, ExperimentState::done);
  EXPECT_NE(view(second).experiment.state, ExperimentState::done);
  until(second, ExperimentState::running);
  const auto last = enqueue(profile({kRest}));
  ASSERT_TRUE(wait_for(experiments->abort(second, "enough", {"boris", "", 0})));
  expect_aborted(second, "requested");
  clock.run_for(3s);
  EXPECT_EQ(view(last).waits_for, "held");
  ASSERT_TRUE(wait_for(experiments->resume(last, {"anna", "", 0})));
  until(last, ExperimentState::done);
}

TEST_F(ExperimentsTest, OneThatWaitsIsCancelled) {
  const auto id = enqueue(profile({kRest}));
  clock.run_for(1s);
  EXPECT_EQ(view(id).waits_for, "nobody_present");
  ASSERT_TRUE(wait_for(experiments->abort(id, "", {"anna", "", 0})));
  EXPECT_EQ(until(id, ExperimentState::cancelled).reason, "requested");
}

TEST_F(ExperimentsTest, AListCountsTheRunsAndOnlyTheOneHasThem) {
  std::vector<storage::RunCounts> reported;
  experiments->set_on_change([&reported](const ExperimentView& summary) {
    EXPECT_TRUE(summary.experiment.runs.empty());
    reported.push_back(summary.experiment.run_counts);
  });
  const auto id = start(profile({kRest}, "[sweep]\nrepeats = 3\n"));
  until(id, ExperimentState::done);
  const storage::RunCounts all_done{{ExperimentState::done, 3}};
  EXPECT_EQ(reported.back(), all_done);
  const storage::RunCounts one_runs{{ExperimentState::done, 2}, {ExperimentState::running, 1}};
  EXPECT_NE(std::ranges::find(reported, one_runs), reported.end());
  const auto listed = wait_for(experiments->list({}));
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_TRUE(listed[0].experiment.runs.empty());
  EXPECT_EQ(listed[0].experiment.run_counts, all_done);
  EXPECT_EQ(view(id).experiment.runs.size(), 3U);
  EXPECT_EQ(view(id).experiment.run_counts, all_done);
  EXPECT_FALSE(experiments->summary(id)) << "it has ended";
  experiments->set_on_change([](const ExperimentView&) {});
}

TEST_F(ExperimentsTest, AWholeQueueIsThereAgainAfterARestart) {
  std::vector<storage::ExperimentId> queue;
  for (std::size_t i = 0; i < kMostQueued; ++i) queue.push_back(enqueue(profile({kRest})));
  begin_again();
  clock.run_for(1s);
  for (const storage::ExperimentId id : queue) {
    const auto summary = experiments->summary(id);
    ASSERT_TRUE(summary) << id;
    EXPECT_EQ(summary->waits_for, "held");
  }
  EXPECT_EQ(try_to_begin(profile({kRest})).error().reason, "too_many_experiments");
}

TEST_F(ExperimentsTest, WaitsForThePersonWhoChangesTheFluid) {
  const std::string head = "[sweep]\nfluids = [\"non_newtonian\", \"water\"]\n";
  const auto id = start(profile({kRest}, head));
  EXPECT_EQ(state().fluid, "non_newtonian");
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "fluid");
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  clock.run_for(1s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused) << "it is in the other fluid still";
  ASSERT_TRUE(station.set_fluid("sim-1", "water", {"anna", "", clock.utc_us()}));
  clock.run_for(3s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused) << "SAFETY: naming the fluid moves nothing";
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  const storage::Experiment ended = until(id, ExperimentState::done);
  EXPECT_EQ(wait_for(runs->find(*ended.runs.at(1).run))->conditions.fluid, "water");
}

// SAFETY: a robot that was switched off while the fluid was changed never goes on with another controller.
TEST_F(ExperimentsTest, AllRunsHaveTheControllerOfTheFirst) {
  come("anna");
  const auto sent = command_by("anna", sim_robot::set_controller(robot_fw::biquad_controller()));
  ASSERT_TRUE(sent) << sent.error().detail;
  const auto id = start(profile({kSetpoint}, "[sweep]\nfluids = [\"non_newtonian\", \"water\"]\n"));
  until(id, ExperimentState::paused);
  switch_off_and_on();
  ASSERT_TRUE(station.set_fluid("sim-1", "water", {"anna", "", clock.utc_us()}));
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  ASSERT_TRUE(clock.run_until([&] { return view(id).experiment.reason == "other_controller"; }, 10s));
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  clock.run_for(10s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused) << "it still is another one";
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
  ASSERT_TRUE(command_by("anna", sim_robot::set_controller(robot_fw::biquad_controller())));
  clock.run_for(1s);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  EXPECT_EQ(until(id, ExperimentState::done).runs.size(), 2U);
}

TEST_F(ExperimentsTest, WaitsForThePersonWhoSetsThePumpAndNobodyIsAskedTwice) {
  const std::string head = "[conditions]\npump = \"constant\"\nmean_flow_m_s = 0.04\n";
  come("anna");
  const auto id = enqueue(profile({kDuty}, head));
  const storage::Experiment paused = until(id, ExperimentState::paused);
  EXPECT_EQ(paused.reason, "pump");
  EXPECT_NE(paused.detail.find("set the pump to 'constant, mean 0.04 m/s' and resume"), std::string::npos)
      << paused.detail;
  clock.run_for(30s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(robot->simulated().motor_duty(), 0) << "SAFETY: nothing moves before somebody has confirmed the flow";
  EXPECT_TRUE(view(id).experiment.runs.empty());
  EXPECT_EQ(wait_for(experiments->resume(id, {"boris", "", 0})).error().reason, "acts_for_another");
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  const storage::Experiment ended = until(id, ExperimentState::done);
  const auto conditions = wait_for(runs->find(*ended.runs.at(0).run))->conditions;
  EXPECT_EQ(conditions.pump_profile, "constant");
  EXPECT_EQ(conditions.mean_flow_m_s, 0.04);
  until(enqueue(profile({kRest}, head)), ExperimentState::done);
  const auto off = enqueue(profile({kRest}));
  EXPECT_EQ(until(off, ExperimentState::paused).reason, "pump");
  EXPECT_NE(view(off).experiment.detail.find("'off'"), std::string::npos) << view(off).experiment.detail;
  ASSERT_TRUE(wait_for(experiments->abort(off, "", {"boris", "", 0})));
  expect_aborted(off, "requested");
}

boost::asio::awaitable<void> pause_it(Experiments& experiments, storage::ExperimentId id) {
  station::Author by{"anna", "", 0};
  co_await experiments.pause(id, std::move(by));
}

boost::asio::awaitable<void> resume_it(Experiments& experiments, storage::ExperimentId id) {
  station::Author by{"anna", "", 0};
  co_await experiments.resume(id, std::move(by));
}

TEST_F(ExperimentsTest, WhoResumedItBeforeItAskedForThePumpHasConfirmedNoFlow) {
  come("anna");
  bool is_resumed = false;
  experiments->set_on_change([&](const ExperimentView& summary) {  // it is about to be prepared
    if (is_resumed || summary.experiment.state != ExperimentState::running) return;
    is_resumed = true;
    tasks.spawn("pause", pause_it(*experiments, summary.experiment.id));
    tasks.spawn("resume", resume_it(*experiments, summary.experiment.id));
  });
  const auto id = enqueue(profile({kDuty}, "[conditions]\npump = \"constant\"\nmean_flow_m_s = 0.04\n"));
  clock.run_for(10s);
  experiments->set_on_change([](const ExperimentView&) {});
  ASSERT_TRUE(is_resumed);
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "pump");
  EXPECT_TRUE(view(id).experiment.runs.empty());
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
}

TEST_F(ExperimentsTest, ThePumpMayTakeLongerThanAnotherPause) {
  come("anna");
  const auto id = enqueue(profile({kDuty}, "[conditions]\npump = \"pulse_70_bpm\"\nmean_flow_m_s = 0.02\n"));
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "pump");
  clock.run_for(11min);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  ASSERT_TRUE(wait_for(experiments->abort(id, "", {"anna", "", 0})));
  expect_aborted(id, "requested");
}

TEST_F(ExperimentsTest, WhatTheStationsLimitsForbidIsNotQueued) {
  const auto refused =
      try_to_begin(profile({"kind = \"setpoint\"\nsetpoint_m = 5\nfor_s = 1"}, "[limits]\nposition_max_m = 9\n"));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().detail.find("step 1"), std::string::npos) << refused.error().detail;
  const auto unread = try_to_begin("name = \"x\"\n");
  ASSERT_FALSE(unread);
  EXPECT_EQ(unread.error().code, ErrorCode::invalid);
}

TEST_F(ExperimentsTest, AControllerThatIsNotThereAbortsBeforeAnythingMoves) {
  experiments->set_controller_by_name(
      [](std::string, station::RobotId) -> boost::asio::awaitable<Result<protocol::Controller>> {
        co_return server::fail(ErrorCode::not_found, "there is none");
      });
  come("anna");
  const auto id = enqueue(profile({kDuty}, "[sweep]\ncontrollers = [\"mine\"]\n"));
  expect_aborted(id, "controller");
  EXPECT_TRUE(view(id).experiment.runs.empty());
}

TEST_F(ExperimentsTest, AnExceptionEndsItAndNothingElse) {
  experiments->set_controller_by_name(
      [](std::string, station::RobotId) -> boost::asio::awaitable<Result<protocol::Controller>> {
        throw std::runtime_error{"a fault"};
        co_return server::fail(ErrorCode::internal, "");
      });
  come("anna");
  const auto id = enqueue(profile({kDuty}, "[sweep]\ncontrollers = [\"mine\"]\n"));
  expect_aborted(id, "internal");
  const auto next = enqueue(profile({kRest}));
  until(next, ExperimentState::done);
}

}  // namespace
}  // namespace server
