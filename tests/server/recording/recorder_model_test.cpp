// The recorder against a naive model, under random batches, duplicates, holes, overruns, reboots, restarts and full
// queues.
#include <map>
#include <random>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class RecorderModelTest : public RecordingTest, public ::testing::WithParamInterface<unsigned> {
 protected:
  // A robot whose ring holds 300 samples; sends any part of it, in any order.
  void act(std::mt19937& random, TestRobot& robot) {
    const auto pick = [&](std::uint64_t limit) { return random() % std::max<std::uint64_t>(limit, 1); };
    switch (pick(12)) {
      case 0: clock_.run_for(microseconds{pick(400'000)}); break;
      case 1: flush(); break;
      case 2: robot.next_seq += pick(40); break;  // made, and their frames were lost
      case 3: robot.context.setpoint_m = static_cast<float>(pick(3)); break;
      case 4: reconnect(random, robot); break;
      case 5:
        if (pick(4) == 0) reboot(robot);
        break;
      case 6:
      case 7: make(robot, 1 + pick(25), 1 + pick(25)); break;
      default: {
        const std::uint64_t first = robot.oldest_seq + pick(robot.next_seq - robot.oldest_seq);
        const std::uint64_t count = std::min(1 + pick(25), robot.next_seq - first);
        if (count > 0) send(robot, first, count);
      }
    }
    trim(robot);
  }

  void reconnect(std::mt19937& random, TestRobot& robot) {
    if (random() % 2 == 0) {
      if (random() % 2 == 0) {
        kill();
      } else {
        stop();
      }
      start(options_);
    } else {
      disconnect(robot);
    }
    connect(robot);
  }

  // What the ring held of the old boot is gone.
  void reboot(TestRobot& robot) {
    disconnect(robot);
    made_by_ended_[robot.boot_id] = robot.next_seq;
    robot.boot_id += 1;
    robot.next_seq = robot.oldest_seq = 0;
    connect(robot);
  }

  // What is durable is forgotten, and the ring holds no more than 300.
  void trim(TestRobot& robot) {
    const std::uint64_t oldest = robot.next_seq > 300 ? robot.next_seq - 300 : 0;
    robot.oldest_seq = std::max({robot.oldest_seq, oldest, durable_next_seqs_[robot.boot_id]});
  }

  // The robot sends all that it still holds.
  void send_the_rest(TestRobot& robot) {
    make(robot, 1);  // tells oldest_seq
    flush();
    for (std::uint64_t seq = robot.oldest_seq; seq < robot.next_seq; seq += 25) {
      send(robot, seq, std::min<std::uint64_t>(25, robot.next_seq - seq));
      flush();
    }
  }

  RecorderOptions options_;
  std::map<BootId, std::uint64_t> made_by_ended_;  // samples
};

TEST_P(RecorderModelTest, StoresOrListsEverySampleExactlyOnce) {
  std::mt19937 random{GetParam()};
  options_.max_queued_samples = GetParam() % 3 == 0 ? 60 : 100'000;
  TestRobot robot;
  start(options_);
  connect(robot);
  const RunId run = wait(runs_->create(robot.id, named("everything")))->id;
  for (int step = 0; step < 150; ++step) act(random, robot);
  send_the_rest(robot);
  EXPECT_EQ(durable_next_seq_, robot.next_seq);

  std::map<BootId, std::map<std::uint64_t, int>> seen;
  for (const StoredSample& stored : wait(history_->samples(run, std::nullopt, 10'000))->samples) {
    ++seen[stored.boot_id][stored.seq];
    ASSERT_FLOAT_EQ(stored.sample.position_m, static_cast<float>(stored.seq) / 1000);
    ASSERT_EQ(stored.robot_time_us, robot.time_of(stored.seq));
  }
  for (const Gap& gap : wait(history_->gaps(excerpt_of(run))).value().gaps) {
    for (std::uint64_t seq = gap.first_seq; seq <= gap.last_seq; ++seq) ++seen[gap.boot_id][seq];
  }
  EXPECT_EQ(seen[robot.boot_id].size(), robot.next_seq);
  for (const auto& [boot_id, samples] : seen) {
    if (samples.empty()) continue;
    for (const auto& [seq, times] : samples) ASSERT_EQ(times, 1) << "boot " << boot_id << " sample " << seq;
    EXPECT_EQ(samples.rbegin()->first + 1, samples.size()) << "boot " << boot_id << " has a hole";
  }
  for (const auto& [boot_id, made] : made_by_ended_) {
    EXPECT_GE(seen[boot_id].size(), durable_next_seqs_[boot_id]);
    EXPECT_LE(seen[boot_id].size(), made);
  }

  const Result<Run> ended = wait(runs_->end(run, "good"));
  EXPECT_EQ(ended->samples_stored + ended->samples_lost, ended->samples_expected);
  EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
}

INSTANTIATE_TEST_SUITE_P(Seeds, RecorderModelTest, ::testing::Range(0u, 24u));

}  // namespace
}  // namespace server
