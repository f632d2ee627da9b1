// The write-ahead log is moved into the database beside the commits, and one that cannot be is noticed.
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <sstream>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

constexpr std::uint64_t kCheckpointBytes = 1 << 20;

class CheckpointTest : public RecordingTest {
 protected:
  CheckpointTest() {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log_)));
    options_.checkpoint_bytes = kCheckpointBytes;
  }
  ~CheckpointTest() override { spdlog::set_default_logger(std::move(usual_)); }

  // About 0.7 MB of log.
  void make_a_second() {
    for (int tenth = 0; tenth < 10; ++tenth) {
      make(robot_, 1000, 500);
      clock_.run_for(100ms);
    }
  }

  std::uintmax_t log_bytes() const { return std::filesystem::file_size(path_.string() + "-wal"); }

  int warnings() const {
    int count = 0;
    const std::string text = log_.str();
    for (std::size_t at = 0; (at = text.find("cannot begin anew", at)) != std::string::npos; ++at) ++count;
    return count;
  }

  RecorderOptions options_;
  TestRobot robot_;
  std::ostringstream log_;
  std::shared_ptr<spdlog::logger> usual_ = spdlog::default_logger();
};

TEST_F(CheckpointTest, TheLogIsMovedBesideTheCommitsAndBeginsAnew) {
  start(options_);
  connect(robot_);
  for (int second = 0; second < 15; ++second) {
    make_a_second();
    EXPECT_LE(recorder_->wal().bytes, 2 * kCheckpointBytes);
    EXPECT_LE(log_bytes(), 2 * kCheckpointBytes);
  }
  EXPECT_GE(recorder_->wal().checkpoints, 5u);
  EXPECT_EQ(recorder_->wal().held_since_us, 0);
  EXPECT_EQ(warnings(), 0);
  EXPECT_EQ(durable_next_seq_, robot_.next_seq);
  EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
}

TEST_F(CheckpointTest, AForeignReaderThatHoldsTheLogIsWarnedOfUntilItEnds) {
  start(options_);
  connect(robot_);
  make_a_second();
  {
    SQLite::Database reader{path_.string(), SQLite::OPEN_READONLY};
    reader.exec("BEGIN");
    reader.execAndGet("SELECT count(*) FROM robot").getInt();
    for (int second = 0; second < 4; ++second) make_a_second();
    EXPECT_EQ(recorder_->wal().held_since_us, 0);
    EXPECT_EQ(warnings(), 0);
    const std::int64_t by_us = clock_.utc_us();
    for (int second = 0; second < 26; ++second) make_a_second();
    EXPECT_GT(recorder_->wal().bytes, 5 * kCheckpointBytes);
    EXPECT_GT(recorder_->wal().held_since_us, by_us - 4'000'000);
    EXPECT_LT(recorder_->wal().held_since_us, by_us);
    EXPECT_EQ(warnings(), 3);  // one in 10 s
    EXPECT_NE(log_.str().find("another program holds a read transaction"), std::string::npos);
    EXPECT_EQ(durable_next_seq_, robot_.next_seq);
  }
  for (int second = 0; second < 3; ++second) make_a_second();
  EXPECT_LE(recorder_->wal().bytes, 2 * kCheckpointBytes);
  EXPECT_EQ(recorder_->wal().held_since_us, 0);
  EXPECT_EQ(warnings(), 3);
}

TEST_F(CheckpointTest, AnIdleStationDoesNotTryAgainAndAgain) {
  start(options_);
  connect(robot_);
  make(robot_, 100'000, 500);
  clock_.run_for(100ms);
  EXPECT_GT(recorder_->wal().bytes, kCheckpointBytes);
  clock_.run_for(3s);
  const std::uint64_t checkpoints = recorder_->wal().checkpoints;
  clock_.run_for(60s);
  EXPECT_EQ(recorder_->wal().checkpoints, checkpoints);
  EXPECT_EQ(recorder_->wal().held_since_us, 0);
  make(robot_, 100);
  clock_.run_for(200ms);
  EXPECT_LT(recorder_->wal().bytes, kCheckpointBytes);
}

}  // namespace
}  // namespace server
