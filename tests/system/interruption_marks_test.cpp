// Where the experiment of a run waited is known of its run, however the wait ends.
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/runs/run_store.hpp"
#include "tests/system/interrupted_fixture.hpp"

namespace server {
namespace {

constexpr const char* kEightSeconds = "kind = \"duty\"\nduty = 0.2\nfor_s = 8";

class InterruptionMarksTest : public InterruptedTest {
 protected:
  // The run as a station finds it that starts again after a kill: a copy of what is on disk now.
  storage::Run run_after_kill(storage::RunId id) {
    storage::Database killed{copy_of_store()};
    storage::RunStore{killed}.interrupt(clock.utc_us());
    EXPECT_EQ(storage::read_interrupted_parts(killed.handle(), id).size(), 1U) << "by the tools, too";
    return storage::find_run(killed.handle(), {}, id).value();
  }
  std::filesystem::path copy_of_store() {
    EXPECT_TRUE(wait_for(recorder->flush()));
    const std::filesystem::path copy = folder / "killed.sqlite";
    auto vacuum = [copy](storage::Database& database) {
      database.handle().exec("VACUUM INTO '" + copy.string() + "'");
      return true;
    };
    wait_for(recorder->on_disk(vacuum));
    return copy;
  }
  storage::RunId first_run_of(storage::ExperimentId id) { return view(id).experiment.runs.at(0).run.value(); }
};

TEST_F(InterruptionMarksTest, APauseInWhichTheStationIsKilledIsMarked) {
  const auto id = start(profile({kEightSeconds}));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(20s);
  const storage::Run run = run_after_kill(first_run_of(id));
  EXPECT_EQ(run.state, storage::RunState::interrupted);
  ASSERT_EQ(run.interrupted.size(), 1U);
  const storage::InterruptedPart& part = run.interrupted.front();
  EXPECT_EQ(part.reason, "requested");
  EXPECT_NEAR(static_cast<double>(part.to_robot_us - part.from_robot_us) / 1e6, 20, 1);
}

// Its robot may have been driven after the kill.
TEST_F(InterruptionMarksTest, AWaitThatAKillEndedMarksNoRunThatIsMadeAfterwards) {
  const auto id = start(profile({kEightSeconds}));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(5s);
  storage::Database killed{copy_of_store()};
  killed.handle().exec("UPDATE run SET state = 'ended', made_afterwards = 1");
  EXPECT_TRUE(storage::find_run(killed.handle(), {}, first_run_of(id)).value().interrupted.empty());
}

TEST_F(InterruptionMarksTest, OneThatLastsIsSeenWhileItsRunIsOpen) {
  const auto id = start(profile({kEightSeconds}));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(10s);
  const storage::Run waiting = run_of(id);
  ASSERT_EQ(waiting.interrupted.size(), 1U);
  const std::uint64_t from_us = waiting.interrupted.front().from_robot_us;
  const std::uint64_t length_us = waiting.interrupted.front().to_robot_us - from_us;
  EXPECT_NEAR(static_cast<double>(length_us) / 1e6, 10, 2) << "up to the newest sample that is stored";
  ASSERT_TRUE(wait_for(experiments->resume(id, {"anna", "", 0})));
  until(id, ExperimentState::done);
  clock.run_for(2s);
  const storage::Run ended = run_of(id);
  ASSERT_EQ(ended.interrupted.size(), 1U) << "its beginning and its end are one part";
  EXPECT_LT(ended.interrupted.front().to_robot_us, state().latest_robot_time_us - 5'000'000);
}

TEST_F(InterruptionMarksTest, TheSecondOfTwoIsSeenBesideTheFirst) {
  const auto id = start(profile({kEightSeconds}));
  clock.run_for(2s);
  lose_link(700ms);
  expect_interrupted(id, "link_lost");
  until(id, ExperimentState::running);
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(5s);
  const storage::Run waiting = run_of(id);
  ASSERT_EQ(waiting.interrupted.size(), 2U);
  EXPECT_EQ(waiting.interrupted[0].reason, "link_lost");
  EXPECT_EQ(waiting.interrupted[1].reason, "requested");
  EXPECT_LT(waiting.interrupted[0].to_robot_us + 1'000'000, waiting.interrupted[1].from_robot_us);
}

// The end of it is noted when the recorder knows the next boot already.
TEST_F(InterruptionMarksTest, OneThatABootEndsIsMarked) {
  const auto id = start(profile({kEightSeconds}));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(5s);
  switch_off_and_on();
  until(id, ExperimentState::aborted);
  clock.run_for(3s);
  const storage::Run run = run_of(id);
  ASSERT_EQ(run.interrupted.size(), 1U);
  EXPECT_EQ(run.interrupted.front().span, 0U);
  const auto length_us = run.interrupted.front().to_robot_us - run.interrupted.front().from_robot_us;
  EXPECT_NEAR(static_cast<double>(length_us) / 1e6, 5, 1);
}

// So long that the recorder keeps nothing of the boot in memory.
TEST_F(InterruptionMarksTest, OneOfARobotThatIsLongAwayIsMarked) {
  const auto id = start(profile({kEightSeconds}));
  clock.run_for(2s);
  ASSERT_TRUE(wait_for(experiments->pause(id, {"anna", "", 0})));
  clock.run_for(3s);
  robot->redial = false;
  robot->cut();
  clock.run_for(120s);
  abort_aside(id);
  until(id, ExperimentState::aborted);
  clock.run_for(3s);
  EXPECT_EQ(run_of(id).interrupted.size(), 1U);
}

}  // namespace
}  // namespace server
