// Commits are of one size whatever arrives at once, and the log beside them stays short.
#include <boost/asio/post.hpp>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class CommitSpreadTest : public RecordingTest {
 protected:
  // They are enrolled, and all connect in one instant.
  void connect_robots(std::size_t count) {
    auto enrol = [count](storage::Database& database) {
      SQLite::Transaction transaction{database.handle()};
      SQLite::Statement add{database.handle(), "INSERT INTO robot (robot_id, enrolled_at_us) VALUES (?, 1)"};
      for (std::size_t n = 0; n < count; ++n) {
        add.bind(1, "r" + std::to_string(n));
        add.exec();
        add.reset();
      }
      transaction.commit();
    };
    wait(recorder_->on_disk(std::move(enrol)));
    for (std::size_t n = 0; n < count; ++n) {
      TestRobot& robot = robots_.emplace_back();
      robot.id = "r" + std::to_string(n);
      robot.boot_id = 1000 + n;
      connect(robot);
    }
  }

  void set_disk_full(bool full) {
    SQLite::Database{path_.string(), SQLite::OPEN_READWRITE}.exec(
        full ? "CREATE TRIGGER full BEFORE INSERT ON segment BEGIN SELECT RAISE(ABORT, 'the disk is full'); END"
             : "DROP TRIGGER full");
  }

  // Numbers that the database stores in full.
  void make_noise(TestRobot& robot, std::size_t count) {
    station::SampleBatch batch = robot.batch(robot.next_seq, count);
    for (station::Sample& sample : batch.samples) {
      sample.velocity_m_s = sample.acceleration_m_s2 = sample.duty = sample.position_m + 0.1F;
      sample.impedance_mv = sample.reference_m = sample.position_m + 0.2F;
    }
    send(robot, batch);
    robot.next_seq += count;
  }

  std::uint64_t made() const { return robots_.size() * robots_.front().next_seq; }
  std::uint64_t written() const { return recorder_->counters().samples_written; }
  std::uintmax_t log_bytes() const { return std::filesystem::file_size(path_.string() + "-wal"); }

  std::vector<TestRobot> robots_;
};

TEST_F(CommitSpreadTest, RobotsThatConnectTogetherAreNotWrittenTogether) {
  constexpr std::size_t kRobots = 1000;
  start();
  connect_robots(kRobots);
  std::uint64_t most = 0;
  for (int tenth = 0; tenth < 40; ++tenth) {
    for (TestRobot& robot : robots_) make(robot, 10, 10);
    const std::uint64_t before = written();
    clock_.run_for(100ms);
    most = std::max(most, written() - before);
    EXPECT_LE(recorder_->queued_samples(), kRobots * 120);
  }
  EXPECT_LE(most, kRobots * 100 * 15 / 100);
  EXPECT_GE(written(), made() - kRobots * 110);
  EXPECT_EQ(number("SELECT count(*) FROM segment WHERE last_seq - first_seq < 99 AND first_seq > 0"), 0);
}

TEST_F(CommitSpreadTest, ABacklogDrainsInBoundedCommitsBesideAShortLog) {
  constexpr std::uint64_t kSamples = 2'000'000;
  start();
  connect_robots(500);
  flush();
  set_disk_full(true);
  while (made() < kSamples) {
    for (TestRobot& robot : robots_) make_noise(robot, 400);
  }
  clock_.run_for(2s);
  ASSERT_TRUE(recorder_->failing());
  ASSERT_EQ(recorder_->queued_samples(), kSamples);
  set_disk_full(false);
  for (int tenth = 0; tenth < 100 && recorder_->queued_samples() > 0; ++tenth) {
    clock_.run_for(100ms);
    ASSERT_LE(log_bytes(), 128U << 20U);
  }
  EXPECT_EQ(recorder_->queued_samples(), 0u);
  EXPECT_EQ(written(), kSamples);
  EXPECT_LE(recorder_->counters().largest_commit_samples, storage::Recorder::kMaxCommitSamples);
  EXPECT_GE(recorder_->counters().commits, kSamples / storage::Recorder::kMaxCommitSamples);
  EXPECT_GE(recorder_->wal().checkpoints, 1u);
  for (const TestRobot& robot : robots_) ASSERT_EQ(durable_next_seqs_[robot.boot_id], robot.next_seq);
}

// What waits for the loop meanwhile, such as an emergency stop, does not wait for all robots.
TEST_F(CommitSpreadTest, WhatIsDurableIsSentInTurnsOfTheLoop) {
  constexpr std::size_t kRobots = 600;
  start();
  connect_robots(kRobots);
  flush();
  std::size_t acknowledged = 0;
  std::vector<std::size_t> seen{0};  // how many were sent when the loop came to other work
  recorder_->set_on_durable([&](const station::RobotId&, station::BootId, std::uint64_t, std::uint64_t) {
    ++acknowledged;
    boost::asio::post(loop_, [&] { seen.push_back(acknowledged); });
  });
  for (TestRobot& robot : robots_) make(robot, 10, 10);
  const std::uint64_t commits = recorder_->counters().commits;
  flush();
  EXPECT_EQ(recorder_->counters().commits, commits + 1);
  EXPECT_EQ(acknowledged, kRobots);
  for (std::size_t turn = 1; turn < seen.size(); ++turn) EXPECT_LE(seen[turn] - seen[turn - 1], 150u);
}

// A reboot ends the earlier boot only when all that waits of it is written.
TEST_F(CommitSpreadTest, ARebootInABacklogLosesNothingThatWasReceived) {
  start();
  connect_robots(2);
  flush();
  set_disk_full(true);
  make(robots_.back(), 300'000, 500);
  TestRobot rebooted = robots_.back();
  rebooted.boot_id = 5;
  rebooted.next_seq = 0;
  connect(rebooted);
  make(rebooted, 100);
  set_disk_full(false);
  EXPECT_TRUE(wait(recorder_->flush()));
  EXPECT_GE(recorder_->counters().commits, 3u);
  EXPECT_EQ(number("SELECT count(*) FROM gap"), 0);
  EXPECT_EQ(number("SELECT sum(last_seq - first_seq + 1) FROM segment"), 300'100);
  EXPECT_EQ(rows("SELECT ended_next_seq, durable_next_seq FROM boot WHERE boot_id = 1001"),
            std::vector<std::string>{"300000|300000"});
}

}  // namespace
}  // namespace server
