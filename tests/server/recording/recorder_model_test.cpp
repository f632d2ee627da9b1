// The recorder against a naive model, under random batches, duplicates, holes, overruns, reboots, restarts and full
// queues.
#include <map>
#include <random>

#include "server/recording/sample_scanner.hpp"
#include "server/recording/statement.hpp"
#include "server/recording/store_check.hpp"
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
        TestRobot again = robot;
        again.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
        if (count > 0) send(again, first, count);
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

  // How often each sample is stored or listed as lost, boot by boot; each that is stored is what was sent.
  std::map<BootId, std::map<std::uint64_t, int>> recorded(const TestRobot& robot) {
    std::map<BootId, std::map<std::uint64_t, int>> seen;
    SQLite::Database database = open_for_reading(path_);
    SampleScanner scanner{database, all_channels()};
    SQLite::Statement boots{database, "SELECT boot_key, boot_id FROM boot"};
    SQLite::Statement gaps{database, "SELECT first_seq, last_seq FROM gap WHERE boot_key = ?"};
    while (boots.executeStep()) {
      std::map<std::uint64_t, int>& samples = seen[unsigned_id(boots.getColumn(1))];
      Segment segment;
      scanner.begin(boots.getColumn(0).getInt64(), {0, 1U << 30U});
      while (scanner.next(segment)) {
        for (std::size_t index = 0; index < segment.samples.size(); ++index) {
          const std::uint64_t seq = segment.first_seq + index;
          ++samples[seq];
          stored_[unsigned_id(boots.getColumn(1))][seq] = segment.context.flags;
          EXPECT_FLOAT_EQ(segment.samples[index].position_m, static_cast<float>(seq) / 1000);
          EXPECT_EQ(segment.robot_time_us(index), robot.time_of(seq));
        }
      }
      bind_all(gaps, boots.getColumn(0).getInt64());
      while (gaps.executeStep()) {
        for (auto seq = unsigned_id(gaps.getColumn(0)); seq <= unsigned_id(gaps.getColumn(1)); ++seq) ++samples[seq];
      }
    }
    return seen;
  }

  // A run of the whole boot has a certificate that says what a recount of its stored samples says.
  void expect_certified(const TestRobot& robot, BootId boot_id, std::uint64_t next_seq) {
    const auto run = wait(runs_->make_afterwards(robot.id, named("all"), SeqSpan{boot_id, 0, next_seq - 1}, ""));
    ASSERT_TRUE(run.has_value()) << run.error().detail;
    const auto found = wait(recording_->certifier.find(run->id));
    ASSERT_TRUE(found && found->is_final);
    const Certificate& certificate = found->certificate;
    const auto& stored = stored_[boot_id];
    std::uint64_t backfilled = 0;
    std::uint64_t longest = 0;
    std::uint64_t gap = 0;
    for (std::uint64_t seq = 0; seq < next_seq; ++seq) {
      const auto sample = stored.find(seq);
      gap = sample == stored.end() ? gap + 1 : 0;
      longest = std::max(longest, gap);
      if (sample != stored.end()) backfilled += sample->second & 1U;
    }
    EXPECT_EQ(certificate.samples_expected, next_seq);
    EXPECT_EQ(certificate.samples_live, stored.size() - backfilled);
    EXPECT_EQ(certificate.samples_backfilled, backfilled);
    EXPECT_EQ(certificate.samples_lost, next_seq - stored.size());
    EXPECT_EQ(certificate.longest_gap_samples, longest);
  }

  RecorderOptions options_;
  std::map<BootId, std::map<std::uint64_t, std::uint32_t>> stored_;  // flags of each stored sample
  std::map<BootId, std::uint64_t> made_by_ended_;                    // samples
};

TEST_P(RecorderModelTest, StoresOrListsEverySampleExactlyOnce) {
  std::mt19937 random{GetParam()};
  options_.max_queued_samples = GetParam() % 3 == 0 ? 60 : 100'000;
  TestRobot robot;
  start(options_);
  connect(robot);
  for (int step = 0; step < 150; ++step) act(random, robot);
  send_the_rest(robot);
  EXPECT_EQ(durable_next_seq_, robot.next_seq);

  auto seen = recorded(robot);
  EXPECT_EQ(seen[robot.boot_id].size(), robot.next_seq);
  for (const auto& [boot_id, samples] : seen) {
    if (samples.empty()) continue;
    for (const auto& [seq, times] : samples) ASSERT_EQ(times, 1) << "boot " << boot_id << " sample " << seq;
    EXPECT_EQ(samples.rbegin()->first + 1, samples.size()) << "boot " << boot_id << " has a hole";
    expect_certified(robot, boot_id, samples.size());
  }
  for (const auto& [boot_id, made] : made_by_ended_) {
    EXPECT_GE(seen[boot_id].size(), durable_next_seqs_[boot_id]);
    EXPECT_LE(seen[boot_id].size(), made);
  }

  SQLite::Database database = open_for_reading(path_);
  EXPECT_EQ(check_store(database, {.run = {}, .integrity = true})->faults, std::vector<std::string>{});
}

INSTANTIATE_TEST_SUITE_P(Seeds, RecorderModelTest, ::testing::Range(0u, 24u));

}  // namespace
}  // namespace server
