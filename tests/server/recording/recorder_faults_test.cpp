// What the recorder refuses, and what it does while the disk fails, is locked, or its queue is full.
#include "server/storage/ingest/commit_queue.hpp"
#include "tests/server/recording/recorder_fixture.hpp"

namespace server {
namespace {

class RecorderFaultsTest : public RecorderFixture {};

// Another program that has the database locked.
class ForeignWriter {
 public:
  explicit ForeignWriter(const std::filesystem::path& path) : database_{path.string(), SQLite::OPEN_READWRITE, 5000} {}
  void run(const char* sql) { database_.exec(sql); }

 private:
  SQLite::Database database_;
};

TEST_F(RecorderFaultsTest, AFullQueueRefusesAndAsksAgainSoThatSentIsStoredPlusLost) {
  storage::RecorderOptions options;
  options.max_queued_samples = 30;
  start(options);
  connect(robot_);
  make(robot_, 60);  // within one instant: 30 are queued, 30 refused
  EXPECT_EQ(recorder_->counters().samples_refused, 30u);
  EXPECT_EQ(recorder_->queued_samples(), 30u);
  flush();
  EXPECT_EQ(durable_next_seq_, 30u);
  EXPECT_TRUE(clock_.run_until([&] { return !missing_.empty(); }, 2s));
  EXPECT_EQ(missing_.back(), (Missing{30, 60}));
  robot_.oldest_seq = 40;  // too late for ten of them
  send(robot_, 40, 20);
  flush();
  EXPECT_EQ(gaps(), Rows{"30|39|queue_full"});
  EXPECT_EQ(samples() + number("SELECT sum(last_seq - first_seq + 1) FROM gap"), 60);
  EXPECT_EQ(durable_next_seq_, 60u);
}

TEST_F(RecorderFaultsTest, AForeignLockDelaysRecordingAndLosesNothing) {
  start();
  connect(robot_);
  make(robot_, 10);
  flush();
  ForeignWriter foreign{path_};
  foreign.run("BEGIN IMMEDIATE");
  make(robot_, 100);
  EXPECT_TRUE(clock_.run_until([&] { return recorder_->failing(); }, 1s));
  EXPECT_EQ(durable_next_seq_, 10u);
  make(robot_, 20);
  const std::int64_t began_us = clock_.steady_us();
  EXPECT_FALSE(wait(recorder_->flush()));
  EXPECT_EQ(clock_.steady_us() - began_us, 3'000'000);
  TestRobot other;
  other.id = "dory";
  other.boot_id = 7;
  EXPECT_EQ(admit(other).refusal, rheonaut_REFUSAL_REASON_STATION_BUSY);
  foreign.run("ROLLBACK");
  EXPECT_TRUE(wait(recorder_->flush()));
  EXPECT_FALSE(recorder_->failing());
  EXPECT_EQ(durable_next_seq_, 130u);
  EXPECT_EQ(samples(), 130);
  EXPECT_EQ(tasks_->exit_code(), 0);
}

TEST_F(RecorderFaultsTest, AFailingDiskIsTriedAgainEverySecondWithTheSameContent) {
  start();
  connect(robot_);
  flush();
  ForeignWriter foreign{path_};
  foreign.run("CREATE TRIGGER full BEFORE INSERT ON segment BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  make(robot_, 100);
  clock_.run_for(10s);
  EXPECT_TRUE(recorder_->failing());
  EXPECT_GE(recorder_->counters().commits_failed, 9u);
  EXPECT_LE(recorder_->counters().commits_failed, 11u);
  make(robot_, 100);
  foreign.run("DROP TRIGGER full");
  clock_.run_for(1100ms);
  EXPECT_FALSE(recorder_->failing());
  EXPECT_EQ(durable_next_seq_, 200u);
  EXPECT_EQ(segments(), (Rows{"0|99", "100|199"}));
}

TEST_F(RecorderFaultsTest, CloseDoesNotThrowWhenTheDiskFails) {
  start();
  connect(robot_);
  make(robot_, 10);
  ForeignWriter foreign{path_};
  foreign.run("BEGIN IMMEDIATE");
  stop();
  foreign.run("ROLLBACK");
  EXPECT_EQ(samples(), 0);
}

TEST_F(RecorderFaultsTest, AFullQueueStillTakesEveryStopAndTheNewestStateOfACommand) {
  storage::RecorderOptions options;
  options.max_queued_records = 2;
  start(options);
  send_command(1, "set_duty", station::CommandState::queued);
  send_command(2, "set_duty", station::CommandState::queued);
  send_command(3, "set_duty", station::CommandState::queued);  // beyond the limit
  send_command(1, "set_duty", station::CommandState::acknowledged);
  send_command(4, "emergency_stop", station::CommandState::queued);
  send_command(5, "emergency_stop", station::CommandState::queued);
  send_command(5, "emergency_stop", station::CommandState::acknowledged);
  EXPECT_EQ(recorder_->counters().records_refused, 1u);
  flush();
  EXPECT_EQ(rows("SELECT command_id, state FROM command ORDER BY command_id"),
            (Rows{"1|acknowledged", "2|queued", "4|queued", "5|acknowledged"}));
  send_command(4, "emergency_stop", station::CommandState::acknowledged);
  flush();
  EXPECT_EQ(rows("SELECT state FROM command WHERE command_id = 4"), Rows{"acknowledged"});
}

// Nobody sends them again; the queue has room of its own for them, which ends, too.
TEST_F(RecorderFaultsTest, AFullQueueStillTakesWhereAnExperimentWaited) {
  storage::RecorderOptions options;
  options.max_queued_records = 2;
  start(options);
  connect(robot_);
  flush();
  const auto note = [this](const char* kind) {
    station::RobotEvent made;
    made.robot_id = robot_.id;
    made.boot_id = robot_.boot_id;
    made.kind = kind;
    recorder_->on_event(state_of(robot_, station::LinkState::connected), made);
  };
  for (int k = 0; k < 3; ++k) note("fluid_set");
  EXPECT_EQ(recorder_->counters().records_refused, 1U);
  note("experiment_paused");
  note("experiment_interrupted");
  EXPECT_EQ(recorder_->counters().records_refused, 1U);
  flush();
  EXPECT_EQ(rows("SELECT kind, boot_key IS NOT NULL FROM event WHERE kind LIKE 'experiment%' ORDER BY event_row"),
            (Rows{"experiment_paused|1", "experiment_interrupted|1"}));
  for (int k = 0; k < 2; ++k) note("fluid_set");
  for (std::size_t k = 0; k < storage::kMostInterruptions; ++k) note("experiment_paused");
  EXPECT_EQ(recorder_->counters().records_refused, 1U);
  note("experiment_paused");
  EXPECT_EQ(recorder_->counters().records_refused, 2U);
  flush();
  EXPECT_EQ(number("SELECT count(*) FROM event WHERE kind LIKE 'experiment%'"), 2 + 1000);
}

TEST_F(RecorderFaultsTest, AnEventThatTheFullQueueRefusedIsAskedForAgain) {
  storage::RecorderOptions options;
  options.max_queued_records = 2;
  start(options);
  connect(robot_);
  for (std::uint64_t seq = 0; seq < 5; ++seq) send_event(robot_, seq);
  EXPECT_EQ(recorder_->counters().records_refused, 3u);
  for (std::uint64_t next = 2; durable_next_event_seq_ < 5;) {
    const int asked = missing_events_;
    ASSERT_TRUE(clock_.run_until([&] { return missing_events_ > asked; }, 2s));
    EXPECT_EQ(durable_next_event_seq_, next);
    for (std::uint64_t seq = next; seq < 5; ++seq) send_event(robot_, seq);
    clock_.run_for(200ms);
    next += 2;
  }
  EXPECT_EQ(number("SELECT count(*) FROM event"), 5);
  EXPECT_EQ(number("SELECT count(*) FROM event_gap"), 0);
}

}  // namespace
}  // namespace server
