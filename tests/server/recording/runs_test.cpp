// A run holds every sample between its begin and its end, over reboots of the robot, until the station stops.
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class RunsTest : public RecordingTest {
 protected:
  TestRobot robot_;

  storage::RunId create(const std::string& name = "step 1") {
    storage::RunConditions conditions;
    conditions.name = name;
    conditions.fluid = "water";
    conditions.mean_flow_m_s = 0.25;
    conditions.profile = "step";
    const Result<Run> run = wait(runs_->create(robot_.id, conditions, {"token:local", "", 0}));
    EXPECT_TRUE(run.has_value()) << run.error().detail;
    return run ? run->id : 0;
  }
  Run find(storage::RunId id) {
    const Result<Run> run = wait(runs_->find(id));
    EXPECT_TRUE(run.has_value());
    return run.value_or(Run{});
  }
  Run end(storage::RunId id, const std::string& verdict = "good") {
    const Result<Run> run = wait(runs_->end(id, verdict));
    EXPECT_TRUE(run.has_value());
    return run.value_or(Run{});
  }
  void reboot() {
    disconnect(robot_);
    robot_.boot_id += 1;
    robot_.next_seq = robot_.oldest_seq = 0;
    connect(robot_);
  }
  std::int64_t samples_in(storage::RunId id) {
    return number("SELECT count(*) FROM run_sample WHERE run_id = " + std::to_string(id));
  }
};

TEST_F(RunsTest, HoldsTheSamplesBetweenCreateAndEnd) {
  start();
  connect(robot_);
  make(robot_, 30);
  const storage::RunId id = create();
  make(robot_, 250);
  const Run run = end(id);
  make(robot_, 30);
  flush();
  EXPECT_EQ(run.robot_id, "nemo");
  EXPECT_EQ(run.conditions.fluid, "water");
  EXPECT_EQ(run.conditions.mean_flow_m_s, 0.25);
  EXPECT_EQ(run.conditions.profile, "step");
  EXPECT_EQ(run.conditions.verdict, "good");
  EXPECT_EQ(run.state, storage::RunState::ended);
  EXPECT_FALSE(run.made_afterwards);
  EXPECT_EQ(run.made_by, "token:local");
  EXPECT_EQ(run.firmware_version, "1.2.3");
  EXPECT_EQ(run.controller_checksum, 0xfedcba98u);
  EXPECT_TRUE(run.ended_at_us.has_value());
  ASSERT_EQ(run.spans.size(), 1u);
  EXPECT_EQ(run.spans[0].first_seq, 30u);
  EXPECT_EQ(run.spans[0].last_seq, 279u);
  EXPECT_EQ(run.samples_expected, 250u);
  EXPECT_EQ(run.samples_stored, 250u);
  EXPECT_EQ(run.samples_lost, 0u);
  EXPECT_EQ(samples_in(id), 250);
}

TEST_F(RunsTest, AnOpenRunCountsWhatIsOnItsWay) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 100);
  clock_.run_for(150ms);
  make(robot_, 7);
  const Run run = find(id);
  EXPECT_EQ(run.samples_expected, 107u);
  EXPECT_EQ(run.samples_stored, 100u);
  EXPECT_EQ(run.state, storage::RunState::open);
  EXPECT_FALSE(run.spans[0].last_seq.has_value());
}

TEST_F(RunsTest, ReadingRunsWritesNothing) {
  start();
  connect(robot_);
  const storage::RunId ended = create();
  make(robot_, 120);
  end(ended);
  const storage::RunId open = create();
  make(robot_, 30);
  clock_.run_for(1200ms);
  SQLite::Database observer = storage::open_for_reading(path_);
  const auto version = [&observer] { return observer.execAndGet("PRAGMA data_version").getInt64(); };
  const std::int64_t before = version();
  const std::uint64_t commits = recorder_->counters().commits;
  make(robot_, 5);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(find(open).samples_stored, 30u);
    EXPECT_EQ(find(ended).samples_stored, 120u);
    EXPECT_EQ(wait(runs_->list({})).size(), 2u);
  }
  EXPECT_EQ(version(), before);
  EXPECT_EQ(recorder_->counters().commits, commits);
}

// What the recorder keeps with the boot spares the reading of its segments: the same numbers, for any such mark.
TEST_F(RunsTest, CountsAreTheSameHoweverFarTheBootIsSettled) {
  start();
  connect(robot_);
  make(robot_, 20);
  const storage::RunId id = create();
  make(robot_, 130);
  robot_.next_seq += 30;  // 150..179 are lost
  robot_.oldest_seq = 180;
  make(robot_, 100);
  robot_.next_seq += 5;  // on their way
  make(robot_, 100);
  flush();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE, 5000};
  for (const char* mark : {"0", "10", "20", "77", "150", "160", "180", "280"}) {
    foreign.exec(std::string{"UPDATE boot SET durable_next_seq = "} + mark);
    const Run run = find(id);
    EXPECT_EQ(run.samples_expected, 365u) << mark;
    EXPECT_EQ(run.samples_stored, 330u) << mark;
    EXPECT_EQ(run.samples_lost, 30u) << mark;
  }
}

TEST_F(RunsTest, TheEndOfARunCutsNoSegmentOfAnotherRobotShort) {
  TestRobot other;
  other.id = "dory";
  other.boot_id = 7;
  start();
  connect(robot_);
  connect(other);
  const storage::RunId id = create();
  clock_.run_for(1s);
  make(robot_, 30);
  make(other, 30);
  EXPECT_EQ(end(id).samples_stored, 30u);
  EXPECT_EQ(number("SELECT count(*) FROM segment"), 1);
  make(other, 33);  // up to the end of its segment
  flush();
  EXPECT_EQ(number("SELECT count(*) FROM segment"), 2);
}

TEST_F(RunsTest, RefusesASecondRunAnUnknownRobotAndABadName) {
  start();
  EXPECT_EQ(wait(runs_->create("nemo", named("x"))).error().code, ErrorCode::not_connected);
  connect(robot_);
  EXPECT_EQ(wait(runs_->create("nemo", named(""))).error().code, ErrorCode::invalid);
  EXPECT_EQ(wait(runs_->create("nemo", named("two\nlines"))).error().code, ErrorCode::invalid);
  EXPECT_EQ(wait(runs_->create("nemo", named(std::string(201, 'x')))).error().code, ErrorCode::invalid);
  const storage::RunId id = create();
  EXPECT_EQ(wait(runs_->create("nemo", named("x"))).error().code, ErrorCode::conflict);
  end(id);
  create("the next one");
  EXPECT_EQ(wait(runs_->end(id, "")).error().code, ErrorCode::conflict);
  EXPECT_EQ(wait(runs_->end(99, "")).error().code, ErrorCode::not_found);
  EXPECT_EQ(wait(runs_->find(99)).error().code, ErrorCode::not_found);
  disconnect(robot_);
}

TEST_F(RunsTest, ListsNewestFirstInPages) {
  start();
  connect(robot_);
  for (int i = 0; i < 5; ++i) end(create("run " + std::to_string(i)));
  const auto ids = [&](storage::RunId before, std::size_t limit, std::optional<station::RobotId> robot = std::nullopt) {
    std::vector<storage::RunId> found;
    for (const Run& run : wait(runs_->list({robot, std::nullopt, before, limit}))) found.push_back(run.id);
    return found;
  };
  EXPECT_EQ(ids(0, 2), (std::vector<storage::RunId>{5, 4}));
  EXPECT_EQ(ids(4, 2), (std::vector<storage::RunId>{3, 2}));
  EXPECT_EQ(ids(2, 2), (std::vector<storage::RunId>{1}));
  EXPECT_EQ(ids(0, 10, "nemo").size(), 5u);
  EXPECT_TRUE(ids(0, 10, "dory").empty());
}

TEST_F(RunsTest, EndWaitsForBackfillAndAnswersAsSoonAsItIsThere) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 20);
  robot_.next_seq = 40;  // 20..39 are on their way
  make(robot_, 10);
  const std::int64_t begin_us = clock_.steady_us();
  auto backfill = [](VirtualClock& clock, RecordingTest& test, auto send) -> boost::asio::awaitable<void> {
    co_await clock.sleep_for(400ms);
    send(test);
  };
  tasks_->spawn("backfill", backfill(clock_, *this, [this](RecordingTest&) { send(robot_, 20, 20); }));
  const Run run = end(id);
  EXPECT_EQ(run.samples_stored, 50u);
  EXPECT_LE(clock_.steady_us() - begin_us, 500'000);
}

TEST_F(RunsTest, EndAnswersAfter3SecondsWithWhatIsStillMissing) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 20);
  robot_.next_seq = 40;
  make(robot_, 10);
  const std::int64_t begin_us = clock_.steady_us();
  const Run run = end(id);
  EXPECT_EQ(run.samples_expected, 50u);
  EXPECT_EQ(run.samples_stored, 30u);
  EXPECT_NEAR(static_cast<double>(clock_.steady_us() - begin_us), 3e6, 1e5);
  send(robot_, 20, 20);  // comes after all
  flush();
  EXPECT_EQ(find(id).samples_stored, 50u);
}

TEST_F(RunsTest, ARunWithoutSamplesEndsEmpty) {
  start();
  connect(robot_);
  const Run run = end(create());
  EXPECT_TRUE(run.spans.empty());
  EXPECT_EQ(run.samples_expected, 0u);
}

TEST_F(RunsTest, ARebootOpensANewSpanAndWhatItLostIsCounted) {
  start();
  connect(robot_);
  make(robot_, 50);
  const storage::RunId id = create();
  make(robot_, 50);
  robot_.next_seq = 110;  // 100..109 never arrive
  make(robot_, 15);
  reboot();
  make(robot_, 40);
  const Run run = end(id);
  ASSERT_EQ(run.spans.size(), 2u);
  EXPECT_EQ(run.spans[0].first_seq, 50u);
  EXPECT_EQ(run.spans[0].last_seq, 124u);
  EXPECT_EQ(run.spans[1].boot_id, robot_.boot_id);
  EXPECT_EQ(run.spans[1].first_seq, 0u);
  EXPECT_EQ(run.spans[1].last_seq, 39u);
  EXPECT_EQ(run.samples_expected, 115u);
  EXPECT_EQ(run.samples_stored, 105u);
  EXPECT_EQ(run.samples_lost, 10u);
  EXPECT_EQ(samples_in(id), 105);
  EXPECT_EQ(rows("SELECT first_seq, last_seq, cause FROM run_gap"), std::vector<std::string>{"100|109|reboot"});
}

TEST_F(RunsTest, IsInterruptedByAKillAtTheLastSampleThatIsKnown) {
  start();
  connect(robot_);
  make(robot_, 30);
  const storage::RunId id = create();
  station::SampleBatch batch = robot_.batch(30, 100);
  batch.utc_offset_us = clock_.utc_us();
  send(robot_, batch);
  robot_.next_seq = 130;
  flush();
  make(robot_, 44);  // received, but not committed: gone with the station
  kill();
  start();
  const Run run = find(id);
  EXPECT_EQ(run.state, storage::RunState::interrupted);
  ASSERT_EQ(run.spans.size(), 1u);
  EXPECT_EQ(run.spans[0].last_seq, 129u);
  EXPECT_EQ(run.ended_at_us, batch.utc_offset_us + static_cast<std::int64_t>(robot_.time_of(129)));
  EXPECT_EQ(run.samples_expected, 100u);
  EXPECT_EQ(run.samples_stored, 100u);
  EXPECT_EQ(wait(runs_->end(id, "")).error().code, ErrorCode::conflict);
}

TEST_F(RunsTest, WhatTheStationMissedIsRecordedButNotInTheInterruptedRun) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 100);
  flush();
  kill();
  start();
  robot_.next_seq += 200;  // made while there was no station
  const std::uint64_t durable = admit(robot_).durable_next_seq;
  connect(robot_);
  send(robot_, durable, 300 - durable);
  const storage::RunId next = create("the next one");
  make(robot_, 10);
  EXPECT_EQ(end(next).samples_stored, 10u);
  EXPECT_EQ(find(id).spans.at(0).last_seq, 99u);
  EXPECT_EQ(find(id).samples_stored, 100u);
  EXPECT_EQ(number("SELECT sum(last_seq - first_seq + 1) FROM segment"), 310);
}

TEST_F(RunsTest, ARobotThatSaidHowFarItWasMayStillSendTheRestOfAnInterruptedRun) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 50);
  flush();
  disconnect(robot_);
  robot_.next_seq += 20;
  connect(robot_);  // its Hello says that 70 samples were made
  flush();
  kill();
  start();
  EXPECT_EQ(find(id).spans.at(0).last_seq, 69u);
  EXPECT_EQ(find(id).samples_stored, 50u);
  connect(robot_);
  send(robot_, 50, 20);
  flush();
  EXPECT_EQ(find(id).samples_stored, 70u);
}

TEST_F(RunsTest, AnOrderlyStopInterruptsARunWithEverySampleThatWasReceived) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 130);
  stop();
  EXPECT_EQ(rows("SELECT state, last_seq FROM run JOIN run_span USING (run_id)"),
            std::vector<std::string>{"interrupted|129"});
  EXPECT_EQ(samples_in(id), 130);
}

TEST_F(RunsTest, ARebootJustBeforeAnOrderlyStopIsInTheInterruptedRun) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 50);
  reboot();
  make(robot_, 20);
  stop();
  EXPECT_EQ(samples_in(id), 70);
  EXPECT_EQ(rows("SELECT span, first_seq, last_seq FROM run_span"), (std::vector<std::string>{"0|0|49", "1|0|19"}));
}

TEST_F(RunsTest, AnInterruptedRunWithoutSamplesIsEmpty) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  kill();
  start();
  const Run run = find(id);
  EXPECT_EQ(run.state, storage::RunState::interrupted);
  EXPECT_TRUE(run.spans.empty());
  EXPECT_EQ(run.ended_at_us, run.started_at_us);
  reboot();
  make(robot_, 20);
  EXPECT_TRUE(find(id).spans.empty());
}

}  // namespace
}  // namespace server
