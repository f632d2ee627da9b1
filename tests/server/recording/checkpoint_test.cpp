// The write-ahead log is moved into the database beside the commits, and one that cannot be is noticed.
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <fmt/format.h>

#include <algorithm>
#include <random>
#include <sstream>

#include "server/api/routes/csv_export.hpp"
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

  storage::RecorderOptions options_;
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

// Commits wait from half again as much log on, so this is how far the last one may take it: below 128 MB.
TEST_F(CheckpointTest, TheLargestCommitFitsBetweenHalfAgainAndTwiceTheLog) {
  start();
  std::mt19937 random{1};
  std::vector<TestRobot> robots(1000);
  for (std::size_t i = 0; i < robots.size(); ++i) {
    robots[i].id = fmt::format("r{}", i);
    robots[i].boot_id = i + 1;
    connect(robots[i]);
    make(robots[i], 1);
  }
  clock_.run_for(3s);
  const std::uint64_t before = recorder_->wal().bytes;
  for (TestRobot& robot : robots) {
    station::SampleBatch batch = robot.batch(robot.next_seq, 200);
    for (station::Sample& sample : batch.samples) {
      for (float* channel : {&sample.position_m, &sample.velocity_m_s, &sample.acceleration_m_s2, &sample.impedance_mv,
                             &sample.duty, &sample.reference_m}) {
        *channel = std::uniform_real_distribution<float>{-1, 1}(random);
      }
    }
    send(robot, batch);
  }
  flush();
  EXPECT_GE(recorder_->counters().largest_commit_samples, 150'000U);
  EXPECT_EQ(number("SELECT count(*) FROM sample"), 201'000);
  EXPECT_LE(recorder_->wal().bytes - before, storage::RecorderOptions{}.checkpoint_bytes / 2);
}

// As exports do: one read transaction follows another, each through many commits, and none of them stays for long.
TEST_F(CheckpointTest, ReadersWithoutAPauseDoNotMakeTheLogLong) {
  start(options_);
  connect(robot_);
  make_a_second();
  runtime::WorkerThread exports{"exports"};
  bool reads = true;
  int pages = 0;
  auto read = [path = path_] {
    SQLite::Database database = storage::open_for_reading(path);
    const SQLite::Transaction page{database};
    const auto end = std::chrono::steady_clock::now() + 50ms;
    do {
      database.execAndGet("SELECT count(*) FROM robot").getInt();
    } while (std::chrono::steady_clock::now() < end);
  };
  // The lambda outlives its coroutine. NOLINTNEXTLINE(cppcoreguidelines-avoid-capturing-lambda-coroutines)
  auto read_on = [&]() -> boost::asio::awaitable<void> {
    while (reads) {
      co_await exports.run(read);
      ++pages;
    }
  };
  tasks_->spawn("exports", read_on());
  for (int second = 0; second < 30; ++second) {
    make_a_second();
    EXPECT_LE(recorder_->wal().bytes, 2 * kCheckpointBytes);
  }
  reads = false;
  while (exports.jobs() > 0) loop_.run_one();
  clock_.settle();
  EXPECT_GT(pages, 1);
  EXPECT_EQ(durable_next_seq_, robot_.next_seq);
}

// A client takes a piece of a CSV, 2000 samples, every two minutes. A read transaction through all of it would hold
// tens of MB of log.
TEST_F(CheckpointTest, AnExportThatTakesAnHourDoesNotMakeTheLogLong) {
  start(options_);
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("to export")))->id;
  for (int i = 0; i < 8; ++i) {
    make(robot_, 8'000, 500);
    clock_.run_for(1s);
  }
  wait(runs_->end(run, ""));
  auto spans = wait(recording_->exports.spans(storage::excerpt_of(run))).value();
  api::CsvStream csv{
      recording_->exports, std::move(spans), {.run = run, .channels = storage::all_channels(), .grid_us = {}}};
  std::ptrdiff_t lines = 0;
  bool ended = false;
  const auto take = [&] {
    const auto piece = wait(csv.next()).value();
    ended = !piece;
    if (piece) lines += std::ranges::count(*piece, '\n');
  };
  std::uint64_t longest = 0;
  for (int second = 0; second < 3600; second += 5) {
    if (second % 120 == 0) take();
    make(robot_, 500, 500);
    clock_.run_for(5s);
    longest = std::max(longest, recorder_->wal().bytes);
  }
  EXPECT_FALSE(ended) << "it lasted through the hour";
  EXPECT_LE(longest, 2 * kCheckpointBytes);
  EXPECT_LE(log_bytes(), 2 * kCheckpointBytes);
  EXPECT_GE(recorder_->wal().checkpoints, 20U);
  EXPECT_EQ(warnings(), 0);
  while (!ended) take();
  EXPECT_EQ(lines, 64'001);  // and the header
  EXPECT_EQ(durable_next_seq_, robot_.next_seq);
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
  clock_.run_for(75s);  // in which groups of segments are made, and moved
  const std::uint64_t checkpoints = recorder_->wal().checkpoints;
  clock_.run_for(150s);
  EXPECT_EQ(recorder_->wal().checkpoints, checkpoints);
  EXPECT_EQ(recorder_->wal().held_since_us, 0);
  make(robot_, 100);
  clock_.run_for(200ms);
  EXPECT_LT(recorder_->wal().bytes, kCheckpointBytes);
}

}  // namespace
}  // namespace server
