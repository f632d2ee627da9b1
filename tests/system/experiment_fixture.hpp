// A station with its experiments and a simulated robot, in one process and in virtual time; people are there, or not.
#pragma once

#include <fmt/format.h>

#include <future>
#include <map>

#include "server/experiments/runner/experiments.hpp"
#include "tests/system/station_fixture.hpp"

namespace server {

using storage::ExperimentState;

class ExperimentTest : public SystemTest {
 public:
  explicit ExperimentTest(bool allow_unattended = false) {
    clock.add_worker(maths);
    make(allow_unattended);
  }
  ~ExperimentTest() override {
    tasks.stop();
    clock.settle();
  }

 protected:
  // As a station that is started again: with what is on disk, and nothing else.
  void begin_again() {
    before_.push_back(std::move(experiments));
    make(false);
  }

  // A profile of these steps; each is e.g. "kind = \"duty\"\nduty = 0.3\nfor_s = 2".
  static std::string profile(std::initializer_list<const char*> steps, const std::string& head = "") {
    std::string text = "name = \"of a test\"\npurpose = \"to test\"\n" + head;
    for (const char* step : steps) text += fmt::format("[[step]]\n{}\n", step);
    return text;
  }

  // From now on the actor gives a sign of life ten times a second, until leave().
  void come(const std::string& actor) {
    if (is_there_.contains(actor)) {
      is_there_[actor] = true;
      return;
    }
    is_there_[actor] = true;
    tasks.spawn("signs of life", stay(actor));
    clock.run_for(100ms);
  }
  void leave(const std::string& actor) { is_there_[actor] = false; }

  Result<server::experiments::ExperimentView> try_to_begin(const std::string& document,
                                                           const std::string& actor = "anna",
                                                           bool is_unattended = false) {
    storage::ExperimentRequest request;
    request.robot_id = "sim-1";
    request.profile = document;
    request.is_unattended = is_unattended;
    return wait_for(experiments->begin(std::move(request), {actor, "127.0.0.1", 0}));
  }
  storage::ExperimentId enqueue(const std::string& document, const std::string& actor = "anna") {
    const auto begun = try_to_begin(document, actor);
    EXPECT_TRUE(begun) << begun.error().detail;
    return begun ? begun->experiment.id : 0;
  }
  // It runs, and its first step has begun.
  storage::ExperimentId start(const std::string& document, const std::string& actor = "anna") {
    come(actor);
    const storage::ExperimentId id = enqueue(document, actor);
    until(id, ExperimentState::running);
    EXPECT_TRUE(clock.run_until([&] { return view(id).progress && view(id).progress->elapsed_s > 0; }, 20s));
    return id;
  }

  server::experiments::ExperimentView view(storage::ExperimentId id) { return wait_for(experiments->find(id)).value(); }
  storage::Experiment until(storage::ExperimentId id, ExperimentState wanted, microseconds limit = 60s) {
    const std::int64_t ends_us = clock.steady_us() + limit.count();
    while (view(id).experiment.state != wanted && clock.steady_us() < ends_us) clock.run_for(50ms);
    const storage::Experiment now = view(id).experiment;
    EXPECT_EQ(text(now.state), std::string{text(wanted)}) << now.reason << ": " << now.detail;
    return now;
  }
  // It was aborted for this reason, and the robot is at rest.
  void expect_aborted(storage::ExperimentId id, const std::string& reason, microseconds limit = 60s) {
    const storage::Experiment ended = until(id, ExperimentState::aborted, limit);
    EXPECT_EQ(ended.reason, reason) << ended.detail;
    EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
    EXPECT_EQ(robot->simulated().motor_duty(), 0);
    clock.run_for(2s);
    EXPECT_EQ(robot->simulated().motor_duty(), 0) << "nothing that waited acts later";
  }

  std::vector<storage::StoredSample> samples_of_first_run(storage::ExperimentId id) {
    clock.run_for(2s);
    return samples_of(view(id).experiment.runs.at(0).run.value());
  }
  Result<station::CommandRecord> command_by(const std::string& actor, const protocol::Command& action) {
    station::CommandRequest request;
    request.robot_id = "sim-1";
    request.action = action;
    request.actor = actor;
    request.peer = "127.0.0.1";
    return wait_for(station.submit(std::move(request)));
  }
  Result<station::ControlState> control_by(const std::string& actor, station::ControlAction action) {
    station::ControlRequest request;
    request.robot_id = "sim-1";
    request.actor = actor;
    request.action = action;
    request.reason = "a test";
    return station.control(request);
  }

  // The robot is off for a second, and has booted again.
  void switch_off_and_on() {
    robot->redial = false;
    robot->cut();
    clock.run_for(1s);
    switched_off_.push_back(std::move(robot));
    sim_robot::SimulatedRobotConfig rebooted;
    rebooted.boot_id = 2;
    robot = std::make_unique<VirtualRobot>(loop, clock, tasks, rebooted);
    robot->dial(*listener);
    EXPECT_TRUE(clock.run_until([&] { return state().boot_id == 2 && state().sample; }, 5s));
  }

  // Anna asks for an experiment; its profile is read when let_worker_go() lets the worker go on. No time may pass
  // before.
  void request_behind_work(std::string document) {
    tasks.spawn("work before it", wait_at_gate());
    tasks.spawn("a request", request(std::move(document)));
  }
  void let_worker_go(bool is_accepted = true) {
    EXPECT_FALSE(answered) << "its profile waits to be read";
    gate_.set_value();
    EXPECT_TRUE(clock.run_until([&] { return answered && answered->has_value() == is_accepted; }, 5s));
  }
  std::optional<Result<server::experiments::ExperimentView>> answered;  // that request

  void abort_aside(storage::ExperimentId id) { tasks.spawn("an abort", abort(id)); }

  runtime::WorkerThread maths{"maths"};
  std::unique_ptr<server::experiments::Experiments> experiments;

 private:
  static constexpr storage::ExperimentId kMostOfATest = 300;

  void make(bool allow_unattended) {
    const server::experiments::DriverParts parts{loop, clock, tasks, station};
    experiments = std::make_unique<server::experiments::Experiments>(
        parts, *recording, maths, config::ExperimentRules{.allow_unattended = allow_unattended});
    tasks.spawn("experiments", experiments->run());
    clock.run_for(50ms);
  }

  boost::asio::awaitable<void> wait_at_gate() {
    auto job = [opened = gate_.get_future().share()] { opened.wait(); };
    co_await maths.run(std::move(job));
  }
  boost::asio::awaitable<void> request(std::string document) {
    storage::ExperimentRequest request;
    request.robot_id = "sim-1";
    request.profile = std::move(document);
    const station::Author by{"anna", "127.0.0.1", 0};
    answered = co_await experiments->begin(std::move(request), by);
  }

  boost::asio::awaitable<void> abort(storage::ExperimentId id) {
    const station::Author by{"anna", "127.0.0.1", 0};
    co_await experiments->abort(id, "", by);
  }

  // For all that it controls, and all experiments that are in its hands.
  void give_sign_of_life(const std::string& actor) {
    station.keep_control({actor, ""}, std::nullopt, 20ms);
    for (storage::ExperimentId id = 1; id < kMostOfATest; ++id) experiments->keep_alive(id, {actor, ""}, 20ms);
  }

  boost::asio::awaitable<void> stay(std::string actor) {
    for (;;) {
      if (is_there_[actor]) give_sign_of_life(actor);
      co_await clock.sleep_for(100ms);
    }
  }

  std::promise<void> gate_;
  std::vector<std::unique_ptr<VirtualRobot>> switched_off_;
  std::vector<std::unique_ptr<server::experiments::Experiments>> before_;
  std::map<std::string, bool> is_there_;
};

}  // namespace server
