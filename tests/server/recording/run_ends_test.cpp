// The end of a run is fixed when it is asked for, and stored however long the disk fails: with the samples of before
// it, and no later than those of after it.
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class RunEndsTest : public RecordingTest {
 protected:
  storage::RunId begin() {
    start();
    connect(robot_);
    const storage::RunId id = create().value().id;
    make(robot_, 100);
    flush();
    return id;
  }
  Result<Run> create() {
    storage::RunConditions conditions;
    conditions.name = "of a test";
    return wait(runs_->create(robot_.id, conditions));
  }
  Result<Run> end(storage::RunId id) { return wait(runs_->end(id, "good", {"anna", "", 0})); }
  Run find(storage::RunId id) { return wait(runs_->find(id)).value(); }

  // No commit succeeds until mend().
  void fail_disk() {
    SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE, 5000};
    foreign.exec("CREATE TRIGGER full BEFORE UPDATE ON meta BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  }
  void mend() {
    SQLite::Database{path_.string(), SQLite::OPEN_READWRITE, 5000}.exec("DROP TRIGGER full");
    EXPECT_TRUE(clock_.run_until([&] { return !recorder_->failing(); }, 5s));
  }
  // After a failing disk: it ended behind its 120 samples, whatever came then.
  void expect_ended_at_120(storage::RunId id) {
    const Run run = find(id);
    EXPECT_EQ(run.state, storage::RunState::ended);
    EXPECT_EQ(run.conditions.verdict, "good");
    ASSERT_EQ(run.spans.size(), 1U);
    EXPECT_EQ(run.spans[0].last_seq, 119U);
    EXPECT_EQ(run.samples_expected, 120U);
  }

  TestRobot robot_;
};

TEST_F(RunEndsTest, AnEndThatTheDiskDoesNotTakeIsStoredWhenItCanBe) {
  const storage::RunId id = begin();
  std::vector<storage::RunState> reported;
  runs_->set_on_change([&](const Run& run) { reported.push_back(run.state); });
  fail_disk();
  make(robot_, 20);
  const auto asked_at_us = clock_.utc_us();
  const auto refused = end(id);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unavailable);
  EXPECT_EQ(refused.error().reason, "end_not_stored");
  make(robot_, 300);
  EXPECT_EQ(end(id).error().reason, "being_ended") << "its end is fixed";
  EXPECT_EQ(create().error().code, ErrorCode::unavailable);
  EXPECT_EQ(find(id).state, storage::RunState::open);
  mend();
  clock_.run_for(1s);
  expect_ended_at_120(id);
  EXPECT_EQ(find(id).ended_at_us, asked_at_us);
  EXPECT_EQ(reported, std::vector{storage::RunState::ended}) << "who asked has gone";
  EXPECT_TRUE(wait(recording_->digester.find(id))->is_final);
  EXPECT_EQ(end(id).error().code, ErrorCode::conflict) << "it has ended already";
  EXPECT_TRUE(create());
}

TEST_F(RunEndsTest, WhoWaitsForItGetsItHoweverLongTheDiskFails) {
  const storage::RunId id = begin();
  fail_disk();
  make(robot_, 20);
  std::optional<Result<Run>> ended;
  const auto ask = [&]() -> boost::asio::awaitable<void> {
    std::string verdict = "good";
    station::Author by{"anna", "", 0};
    ended = co_await runs_->end(id, std::move(verdict), std::move(by), storage::Runs::Patience::until_stored);
  };
  tasks_->spawn("end", ask());
  clock_.run_for(30s);
  EXPECT_FALSE(ended);
  mend();
  clock_.run_for(4s);
  ASSERT_TRUE(ended);
  ASSERT_TRUE(*ended);
  expect_ended_at_120(id);
}

TEST_F(RunEndsTest, ARebootMeanwhileIsNoPartOfIt) {
  const storage::RunId id = begin();
  fail_disk();
  make(robot_, 20);
  EXPECT_FALSE(end(id));
  disconnect(robot_);
  robot_.boot_id += 1;
  robot_.next_seq = robot_.oldest_seq = 0;
  connect(robot_);
  make(robot_, 50);
  mend();
  clock_.run_for(1s);
  expect_ended_at_120(id);
}

TEST_F(RunEndsTest, ARebootBeforeItIs) {
  const storage::RunId id = begin();
  fail_disk();
  disconnect(robot_);
  robot_.boot_id += 1;
  robot_.next_seq = robot_.oldest_seq = 0;
  connect(robot_);
  make(robot_, 50);
  EXPECT_FALSE(end(id));
  make(robot_, 50);
  mend();
  clock_.run_for(1s);
  const Run run = find(id);
  ASSERT_EQ(run.spans.size(), 2U);
  EXPECT_EQ(run.spans[1].boot_id, robot_.boot_id);
  EXPECT_EQ(run.spans[1].last_seq, 49U);
}

TEST_F(RunEndsTest, AfterAKillItEndsThereOrEarlier) {
  const storage::RunId id = begin();
  fail_disk();
  make(robot_, 20);
  EXPECT_FALSE(end(id));
  make(robot_, 300);
  kill();
  SQLite::Database{path_.string(), SQLite::OPEN_READWRITE, 5000}.exec("DROP TRIGGER full");
  start();
  const Run run = find(id);
  EXPECT_EQ(run.state, storage::RunState::interrupted);
  EXPECT_EQ(run.spans.at(0).last_seq, 99U);
}

// Its boot is not in memory any more.
TEST_F(RunEndsTest, OfARobotThatIsLongAwayItEndsAtItsLastSample) {
  const storage::RunId id = begin();
  clock_.run_for(70s);
  disconnect(robot_);
  clock_.run_for(75s);
  const auto ended = end(id);
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->spans.at(0).last_seq, 99U);
}

// Also when the very next commit is the one that brings samples of after it.
TEST_F(RunEndsTest, NoSampleOfAfterItIsStoredBefore) {
  const storage::RunId id = begin();
  fail_disk();
  make(robot_, 20);
  EXPECT_FALSE(end(id));
  make(robot_, 300);
  mend();
  kill();  // after the first commit that succeeds
  start();
  expect_ended_at_120(id);
}

}  // namespace
}  // namespace server
