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

}  // namespace
}  // namespace server
