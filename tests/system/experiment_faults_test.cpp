// SAFETY: an experiment whose robot stops by itself, and one that the disk does not take as it is to be.
#include <thread>

#include "server/experiments/runner/stubborn_writer.hpp"
#include "server/storage/experiments/experiment_store.hpp"
#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;

constexpr const char* kTenSeconds = "kind = \"duty\"\nduty = 0.2\nfor_s = 10";
constexpr const char* kRest = "kind = \"rest\"\nfor_s = 1";

class ExperimentFaultsTest : public ExperimentTest {
 protected:
  static sim_robot::SimulatedRobotConfig default_sensor() {
    sim_robot::SimulatedRobotConfig config;
    config.world.imu.emplace();
    return config;
  }
};

TEST_F(ExperimentFaultsTest, ARobotThatStopsByItselfIsNotMovedByTheNextStep) {
  begin(default_sensor());
  come("anna");
  ASSERT_TRUE(command_by("anna", sim_robot::set_parameter("position_limit_max_m", 0.08F)));
  clock.run_for(1s);
  const auto id =
      start(profile({"kind = \"duty\"\nduty = 0.3\nfor_s = 20", "kind = \"setpoint\"\nsetpoint_m = -0.05\nfor_s = 6"}));
  expect_aborted(id, "position_uncertain");
  clock.run_for(20s);
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
}

class WriterTest : public ExperimentFaultsTest {
 protected:
  // The change is asked for now.
  void ask(const std::string& what, std::function<void(storage::Database&)> change) {
    const auto keep = [](WriterTest& test, std::string name,
                         std::function<void(storage::Database&)> wanted) -> boost::asio::awaitable<void> {
      try {
        co_await test.writer_.keep(name, std::move(wanted));
      } catch (const std::runtime_error& error) {
        test.done_.emplace_back(error.what());
        co_return;
      }
      test.done_.push_back(std::move(name));
    };
    tasks.spawn(what, keep(*this, what, std::move(change)));
  }

  std::vector<std::string> done_;

 private:
  StubbornWriter writer_{loop, clock, *recorder};
};

TEST_F(WriterTest, WhatIsTriedAgainIsStoredBeforeWhatCameLater) {
  int tries = 0;
  ask("first", [&tries](storage::Database&) {
    if (tries++ < 2) throw SQLite::Exception{"the disk is full", SQLITE_FULL};
  });
  ask("second", [](storage::Database&) {});
  clock.run_for(1500ms);
  EXPECT_EQ(done_, std::vector<std::string>{});
  clock.run_for(1s);
  EXPECT_EQ(done_, (std::vector<std::string>{"first", "second"}));
}

TEST_F(WriterTest, WhatNoDiskTakesIsNotTriedAgainAndKeepsNothing) {
  ask("first", [](storage::Database&) { throw SQLite::Exception{"UNIQUE", SQLITE_CONSTRAINT}; });
  ask("second", [](storage::Database&) {});
  clock.run_for(100ms);
  ASSERT_EQ(done_.size(), 2U);
  EXPECT_EQ(done_[0], "first cannot be stored: SQLite says 'UNIQUE' (code -1)");
  EXPECT_EQ(done_[1], "second");
}

TEST_F(ExperimentFaultsTest, OneWhoseRunNoDiskTakesEndsAndTheNextMayBegin) {
  begin();
  const auto id = enqueue(profile({kTenSeconds})), next = enqueue(profile({kRest}));
  auto add = [id](storage::Database& database) {
    storage::ExperimentRun run;
    run.number = 1;
    storage::add_experiment_run(database, id, run, "");
    return true;
  };
  wait_for(recorder->on_disk(add));
  come("anna");
  expect_aborted(id, "internal");
  EXPECT_EQ(view(next).waits_for, "held");
  ASSERT_TRUE(wait_for(experiments->resume(next, {"anna", "", 0})));
  until(next, ExperimentState::done);
}

TEST_F(ExperimentFaultsTest, AnAbortBetweenARequestAndItsPlaceInTheQueueHoldsIt) {
  begin();
  come("anna");
  const auto id = enqueue(profile({kTenSeconds}, "[conditions]\npump = \"constant\"\nmean_flow_m_s = 0.04\n"));
  until(id, ExperimentState::paused);
  request_behind_work(profile({kTenSeconds}));
  abort_aside(id);
  while (experiments->summary(id)) {
    loop.restart();
    loop.poll();
    std::this_thread::yield();
  }
  let_worker_go();
  clock.run_for(8s);
  EXPECT_EQ(view((*answered)->experiment.id).waits_for, "held");
  EXPECT_EQ(view((*answered)->experiment.id).experiment.reason, "previous_aborted");
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
}

// While the fluid is changed the robot may be switched off; who resumes it may be away for a moment.
TEST_F(ExperimentFaultsTest, ARobotThatWasSwitchedOffForItsFluidGoesOnWhenItsActorIsBack) {
  begin();
  const auto id = start(profile({kRest}, "[sweep]\nfluids = [\"non_newtonian\", \"water\"]\n"));
  until(id, ExperimentState::paused);
  switch_off_and_on();
  ASSERT_TRUE(station.set_fluid("sim-1", "water", {"anna", "", clock.utc_us()}));
  leave("anna");
  clock.run_for(1s);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  clock.run_for(1s);
  come("anna");
  EXPECT_EQ(until(id, ExperimentState::done).runs.size(), 2U);
}

// --- a disk that fails while one runs ---

class FailingDiskTest : public ExperimentFaultsTest {
 protected:
  // No commit succeeds until mend().
  void fail_disk() {
    SQLite::Database foreign{recorder->path().string(), SQLite::OPEN_READWRITE, 5000};
    foreign.exec("CREATE TRIGGER full BEFORE UPDATE ON meta BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  }
  void mend() {
    SQLite::Database{recorder->path().string(), SQLite::OPEN_READWRITE, 5000}.exec("DROP TRIGGER full");
    EXPECT_TRUE(clock.run_until([&] { return !recorder->failing(); }, 5s));
  }
};

TEST_F(FailingDiskTest, TheEndOfARunIsStoredWhenTheDiskIsBackAndTheNextOnesRun) {
  begin();
  const auto id = start(profile({"kind = \"duty\"\nduty = 0.2\nfor_s = 2"}, "[sweep]\nrepeats = 2\n"));
  const auto next = enqueue(profile({kRest}));
  clock.run_for(1s);
  fail_disk();
  clock.run_for(8s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running);
  EXPECT_EQ(view(id).activity, "storing the end of its run");
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
  mend();
  const auto done = until(id, ExperimentState::done);
  ASSERT_EQ(done.runs.size(), 2U);
  for (const auto& run : done.runs) {
    const auto recorded = wait_for(runs->find(run.run.value()));
    EXPECT_EQ(recorded->state, storage::RunState::ended);
    EXPECT_LT(recorded->samples_expected, 350U) << "2 s, and what is around them";
  }
  until(next, ExperimentState::done);
}

TEST_F(FailingDiskTest, ARunBeginsWhenTheDiskIsBack) {
  begin();
  come("anna");
  fail_disk();
  const auto id = enqueue(profile({kRest}));
  clock.run_for(8s);
  EXPECT_EQ(view(id).activity, "waiting for the disk, to begin its run");
  mend();
  until(id, ExperimentState::done);
}

TEST_F(FailingDiskTest, ARunThatHasWaitedForLongBeginsWhenSomebodyResumesIt) {
  begin();
  come("anna");
  fail_disk();
  const auto id = enqueue(profile({kRest}));
  EXPECT_EQ(until(id, ExperimentState::paused).reason, "not_recorded");
  mend();
  clock.run_for(20s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
}

TEST_F(FailingDiskTest, ARunThatCannotBeginWaitsForNobodyWhoIsAway) {
  begin();
  come("anna");
  fail_disk();
  const auto id = enqueue(profile({kRest}));
  clock.run_for(5s);
  leave("anna");
  expect_aborted(id, "nobody_present");
}

TEST_F(FailingDiskTest, NothingMovesForLongWhatIsNotRecorded) {
  begin();
  const auto id = start(profile({kTenSeconds}));
  clock.run_for(1s);
  fail_disk();
  clock.run_for(3s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::running) << "half of the ring is 4 s";
  clock.run_for(2500ms);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "not_recorded");
  EXPECT_NE(view(id).experiment.detail.find("the disk is full"), std::string::npos) << view(id).experiment.detail;
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  clock.run_for(2s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused) << "nothing is recorded yet";
  mend();
  clock.run_for(5s);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused) << "until a person resumes it";
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
}

TEST_F(FailingDiskTest, PeopleCommandAndStopTheRobotMeanwhile) {
  begin();
  fail_disk();
  clock.run_for(6s);
  EXPECT_TRUE(command_by("anna", sim_robot::set_duty(0.2F)));
  clock.run_for(100ms);
  EXPECT_NE(robot->simulated().motor_duty(), 0);
  station::StopRequest stop{"sim-1", "anna", "127.0.0.1", "", 0};
  EXPECT_EQ(wait_for(station.emergency_stop(std::move(stop), 1s)).value().state, station::CommandState::acknowledged);
  clock.run_for(50ms);
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
}

// --- a command that comes too late to a robot that rests ---

TEST_F(ExperimentFaultsTest, ALateCommandToARestingRobotIsGivenAgain) {
  begin();
  come("anna");
  const auto id = enqueue(profile({kRest, "kind = \"duty\"\nduty = 0.2\nfor_s = 1"}));
  until(id, ExperimentState::running);
  ASSERT_TRUE(clock.run_until([&] { return view(id).progress && view(id).progress->elapsed_s > 0.55; }, 20s));
  robot->stall(true);  // the duty is sent now, and arrives behind its time and its grace
  clock.run_for(650ms);
  robot->stall(false);
  clock.run_for(300ms);
  EXPECT_EQ(view(id).experiment.state, ExperimentState::paused);
  EXPECT_EQ(view(id).experiment.reason, "command_late") << view(id).experiment.detail;
  until(id, ExperimentState::done);
}

}  // namespace
}  // namespace server
