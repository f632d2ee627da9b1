// The recorder against a naive model, under random batches, duplicates, holes, overruns, reboots, restarts, full queues
// and lost events; and what it says about itself on the way.
#include <map>
#include <random>
#include <set>

#include "server/storage/database/statement.hpp"
#include "server/storage/samples/sample_scanner.hpp"
#include "server/storage/upkeep/store_check.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class RecorderModelTest : public RecordingTest, public ::testing::WithParamInterface<unsigned> {
 protected:
  // A robot whose ring holds 300 samples; sends any part of it, in any order.
  void act(std::mt19937& random, TestRobot& robot) {
    const auto pick = [&](std::uint64_t limit) { return random() % std::max<std::uint64_t>(limit, 1); };
    switch (pick(14)) {
      case 0: clock_.run_for(microseconds{pick(400'000)}); break;
      case 1: flush(); break;
      case 2: robot.next_seq += pick(40); break;  // made, and their frames were lost
      case 3: robot.context.setpoint_m = static_cast<float>(pick(3)); break;
      case 4: reconnect(random, robot); break;
      case 5:
        if (pick(4) == 0) reboot(robot);
        break;
      case 6:
      case 7: make_heard(robot, 1 + pick(25), 1 + pick(25)); break;
      case 8: make_events(random, robot, 1 + pick(4)); break;
      case 9:
        if (missing_events_ != answered_events_) send_events(robot);
        break;
      default: {
        const std::uint64_t first = robot.oldest_seq + pick(robot.next_seq - robot.oldest_seq);
        const std::uint64_t count = std::min(1 + pick(25), robot.next_seq - first);
        TestRobot again = robot;
        again.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
        if (count > 0) send_heard(again, first, count);
      }
    }
    trim(robot);
  }

  // What the queue takes completely counts as received: it waits or is stored from then on.
  void send_heard(const TestRobot& robot, std::uint64_t first_seq, std::size_t count) {
    const std::uint64_t refused = recorder_->counters().samples_refused;
    send(robot, first_seq, count);
    if (recorder_->counters().samples_refused != refused) return;
    for (std::uint64_t seq = first_seq; seq < first_seq + count; ++seq) heard_.insert(seq);
  }

  void make_heard(TestRobot& robot, std::size_t count, std::size_t per_frame) {
    for (; count > 0; count -= std::min(count, per_frame)) {
      const std::size_t size = std::min(count, per_frame);
      robot.next_seq += size;
      send_heard(robot, robot.next_seq - size, size);
    }
  }

  // Every other event is lost on the way.
  void make_events(std::mt19937& random, const TestRobot& robot, std::uint64_t count) {
    for (; count > 0; --count) {
      const std::uint64_t event_seq = next_event_seq_++;
      if (random() % 2 == 0) send_event(robot, event_seq);
    }
  }

  // The oldest event that the robot still holds: of those that are not durable the last 6.
  std::uint64_t oldest_event_seq() const {
    const std::uint64_t oldest = next_event_seq_ > kEventRing ? next_event_seq_ - kEventRing : 0;
    return std::max(oldest, durable_next_event_seq_);
  }

  void send_event(const TestRobot& robot, std::uint64_t event_seq) {
    station::RobotEvent event;
    event.oldest_event_seq = oldest_event_seq();
    const std::uint64_t refused = recorder_->counters().records_refused;
    event.robot_id = robot.id;
    event.boot_id = robot.boot_id;
    event.event_seq = event_seq;
    event.kind = "mode_changed";
    recorder_->on_event(state_of(robot, station::LinkState::connected), event);
    if (recorder_->counters().records_refused == refused) heard_events_.insert(event_seq);
  }

  void send_events(const TestRobot& robot) {
    answered_events_ = missing_events_;
    for (std::uint64_t seq = oldest_event_seq(); seq < next_event_seq_; ++seq) send_event(robot, seq);
  }

  // Each event is stored once or listed as lost; what was received is stored, and what the robot holds is not lost.
  void expect_every_event_once(const TestRobot& robot) {
    std::map<std::uint64_t, int> seen;
    SQLite::Database database = storage::open_for_reading(path_);
    SQLite::Statement ranges{database,
                             "SELECT event_seq, event_seq, 0 FROM event WHERE boot_key = ?1 UNION ALL"
                             " SELECT first_event_seq, last_event_seq, 1 FROM event_gap WHERE boot_key = ?1"};
    ranges.bind(1, key_of(database, robot));
    while (ranges.executeStep()) {
      const bool is_lost = ranges.getColumn(2).getInt() != 0;
      for (auto seq = storage::unsigned_id(ranges.getColumn(0)); seq <= storage::unsigned_id(ranges.getColumn(1));
           ++seq) {
        ++seen[seq];
        if (is_lost) EXPECT_FALSE(heard_events_.contains(seq)) << "event " << seq;
        if (is_lost) EXPECT_LT(seq, oldest_event_seq());
      }
    }
    EXPECT_EQ(seen.size(), next_event_seq_);
    for (const auto& [seq, times] : seen) EXPECT_EQ(times, 1) << "event " << seq;
    if (!seen.empty()) EXPECT_EQ(seen.rbegin()->first + 1, next_event_seq_);
  }

  // What was received is read back from memory and disk, each sample from one of them; nothing else is; and what is
  // stored as durable of a boot is no more than is there.
  void check_on_the_way(const TestRobot& robot) {
    std::set<std::uint64_t> waiting;
    for (const storage::Segment& segment : recorder_->waiting(robot.boot_id, {0, robot.next_seq})) {
      for (std::uint64_t seq = segment.first_seq; seq < segment.next_seq(); ++seq) {
        ASSERT_TRUE(waiting.insert(seq).second) << seq << " waits twice";
        ASSERT_FLOAT_EQ(segment.samples[seq - segment.first_seq].position_m, static_cast<float>(seq) / 1000);
      }
    }
    storage::IntervalSet here;
    SQLite::Database database = storage::open_for_reading(path_);
    SQLite::Statement stored{database,
                             "SELECT first_seq, last_seq + 1, 0 FROM segment WHERE boot_key = ?1 UNION ALL"
                             " SELECT first_seq, last_seq + 1, 1 FROM gap WHERE boot_key = ?1"};
    stored.bind(1, key_of(database, robot));
    while (stored.executeStep()) {
      const storage::Interval range{static_cast<std::uint64_t>(stored.getColumn(0).getInt64()),
                                    static_cast<std::uint64_t>(stored.getColumn(1).getInt64())};
      ASSERT_EQ(count(here.insert(range)), range.next - range.first) << "stored twice";
      const auto waits = waiting.lower_bound(range.first);
      ASSERT_TRUE(waits == waiting.end() || *waits >= range.next) << *waits << " is stored, and waits";
    }
    EXPECT_LE(here.first_hole(), robot.next_seq);
    const std::string boot = " FROM boot WHERE boot_key = " + std::to_string(key_of(database, robot));
    EXPECT_LE(database.execAndGet("SELECT coalesce(max(durable_next_seq), 0)" + boot).getInt64(),
              static_cast<std::int64_t>(here.first_hole()));
    for (const storage::LostRange& gap : recorder_->waiting_gaps(robot.boot_id, {0, robot.next_seq}))
      here.insert(gap.lost);
    for (const std::uint64_t seq : heard_) ASSERT_TRUE(waiting.contains(seq) || here.contains(seq)) << seq;
    for (const std::uint64_t seq : waiting) ASSERT_LT(seq, robot.next_seq);
  }

  static std::int64_t key_of(SQLite::Database& database, const TestRobot& robot) {
    SQLite::Statement query{database, "SELECT boot_key FROM boot WHERE boot_id = ?"};
    query.bind(1, static_cast<std::int64_t>(robot.boot_id));
    return query.executeStep() ? query.getColumn(0).getInt64() : 0;
  }

  void reconnect(std::mt19937& random, TestRobot& robot) {
    if (random() % 2 == 0) {
      if (random() % 2 == 0) {
        kill();
        heard_.clear();  // what waited is gone
        heard_events_.clear();
      } else {
        stop();
      }
      start(options_);
    } else {
      disconnect(robot);
    }
    robot.oldest_event_seq = oldest_event_seq();
    robot.next_event_seq = next_event_seq_;
    connect(robot);
  }

  // What the ring held of the old boot is gone.
  void reboot(TestRobot& robot) {
    disconnect(robot);
    made_by_ended_[robot.boot_id] = robot.next_seq;
    robot.boot_id += 1;
    robot.next_seq = robot.oldest_seq = 0;
    heard_.clear();
    heard_events_.clear();
    next_event_seq_ = durable_next_event_seq_ = 0;
    robot.oldest_event_seq = robot.next_event_seq = 0;
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
  std::map<station::BootId, std::map<std::uint64_t, int>> recorded(const TestRobot& robot) {
    std::map<station::BootId, std::map<std::uint64_t, int>> seen;
    SQLite::Database database = storage::open_for_reading(path_);
    storage::SampleScanner scanner{database, storage::all_channels()};
    SQLite::Statement boots{database, "SELECT boot_key, boot_id FROM boot"};
    SQLite::Statement gaps{database, "SELECT first_seq, last_seq FROM gap WHERE boot_key = ?"};
    while (boots.executeStep()) {
      std::map<std::uint64_t, int>& samples = seen[storage::unsigned_id(boots.getColumn(1))];
      storage::Segment segment;
      scanner.begin(boots.getColumn(0).getInt64(), {0, 1U << 30U});
      while (scanner.next(segment)) {
        for (std::size_t index = 0; index < segment.samples.size(); ++index) {
          const std::uint64_t seq = segment.first_seq + index;
          ++samples[seq];
          stored_[storage::unsigned_id(boots.getColumn(1))][seq] = segment.context.flags;
          EXPECT_FLOAT_EQ(segment.samples[index].position_m, static_cast<float>(seq) / 1000);
          EXPECT_EQ(segment.robot_time_us(index), robot.time_of(seq));
        }
      }
      storage::bind_all(gaps, boots.getColumn(0).getInt64());
      while (gaps.executeStep()) {
        for (auto seq = storage::unsigned_id(gaps.getColumn(0)); seq <= storage::unsigned_id(gaps.getColumn(1)); ++seq)
          ++samples[seq];
      }
    }
    return seen;
  }

  // A run of the whole boot has a digest that says what a recount of its stored samples says.
  void expect_digest(const TestRobot& robot, station::BootId boot_id, std::uint64_t next_seq) {
    const auto run =
        wait(runs_->make_afterwards(robot.id, named("all"), storage::SeqSpan{boot_id, 0, next_seq - 1}, {}));
    ASSERT_TRUE(run.has_value()) << run.error().detail;
    const auto found = wait(recording_->digester.find(run->id));
    ASSERT_TRUE(found && found->is_final);
    const storage::RunDigest& digest = found->digest;
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
    EXPECT_EQ(digest.samples_expected, next_seq);
    EXPECT_EQ(digest.samples_live, stored.size() - backfilled);
    EXPECT_EQ(digest.samples_backfilled, backfilled);
    EXPECT_EQ(digest.samples_lost, next_seq - stored.size());
    EXPECT_EQ(digest.longest_gap_samples, longest);
  }

  static constexpr std::uint64_t kEventRing = 6;

  storage::RecorderOptions options_;
  std::map<station::BootId, std::map<std::uint64_t, std::uint32_t>> stored_;  // flags of each stored sample
  std::map<station::BootId, std::uint64_t> made_by_ended_;                    // samples
  std::set<std::uint64_t> heard_;                                             // of the present boot
  std::set<std::uint64_t> heard_events_;                                      // the same
  std::uint64_t next_event_seq_ = 0;
  int answered_events_ = 0;
};

TEST_P(RecorderModelTest, StoresOrListsEverySampleExactlyOnce) {
  std::mt19937 random{GetParam()};
  options_.max_queued_samples = GetParam() % 3 == 0 ? 60 : 100'000;
  if (GetParam() % 4 == 0) options_.max_queued_records = 3;
  TestRobot robot;
  start(options_);
  connect(robot);
  for (int step = 0; step < 150; ++step) {
    act(random, robot);
    ASSERT_NO_FATAL_FAILURE(check_on_the_way(robot)) << "step " << step;
  }
  send_the_rest(robot);
  EXPECT_EQ(durable_next_seq_, robot.next_seq);
  send_events(robot);
  for (int asked = 0; asked < 100 && durable_next_event_seq_ < next_event_seq_; ++asked) {
    clock_.run_until([&] { return missing_events_ != answered_events_; }, 2s);
    send_events(robot);
    flush();
  }
  EXPECT_EQ(durable_next_event_seq_, next_event_seq_);
  expect_every_event_once(robot);

  auto seen = recorded(robot);
  EXPECT_EQ(seen[robot.boot_id].size(), robot.next_seq);
  for (const auto& [boot_id, samples] : seen) {
    if (samples.empty()) continue;
    for (const auto& [seq, times] : samples) ASSERT_EQ(times, 1) << "boot " << boot_id << " sample " << seq;
    EXPECT_EQ(samples.rbegin()->first + 1, samples.size()) << "boot " << boot_id << " has a hole";
    expect_digest(robot, boot_id, samples.size());
  }
  for (const auto& [boot_id, made] : made_by_ended_) {
    EXPECT_GE(seen[boot_id].size(), durable_next_seqs_[boot_id]);
    EXPECT_LE(seen[boot_id].size(), made);
  }

  SQLite::Database database = storage::open_for_reading(path_);
  EXPECT_EQ(storage::check_store(database, {.run = {}, .integrity = true})->faults, std::vector<std::string>{});
}

INSTANTIATE_TEST_SUITE_P(Seeds, RecorderModelTest, ::testing::Range(0u, 24u));

// Robots that send again only what they are asked for.
class OverloadTest : public RecordingTest {
 protected:
  static constexpr std::size_t kRing = 150;

  void begin(std::size_t robots) {
    storage::RecorderOptions options;
    options.max_queued_samples = 500;
    start(options);
    recorder_->set_on_missing(
        [this](const station::RobotId&, station::BootId boot, std::uint64_t first_seq, std::uint64_t next_seq) {
          asked_[boot] = {first_seq, next_seq};
          ++times_asked_;
        });
    for (std::size_t n = 0; n < robots; ++n) {
      TestRobot& robot = robots_.emplace_back();
      robot.id = "r" + std::to_string(n);
      robot.boot_id = 100 + n;
      connect(robot);
    }
  }

  // A tenth of a second: every robot makes `live` samples, and sends again as many of those it was asked for.
  void pass(std::size_t live) {
    for (TestRobot& robot : robots_) {
      robot.next_seq += live;
      const std::uint64_t oldest = robot.next_seq > kRing ? robot.next_seq - kRing : 0;
      robot.oldest_seq = std::max({robot.oldest_seq, oldest, durable_next_seqs_[robot.boot_id]});
      if (live > 0) send(robot, robot.next_seq - live, live);
      Missing& asked = asked_[robot.boot_id];
      asked.first_seq = std::max(asked.first_seq, robot.oldest_seq);
      const std::uint64_t end = std::min(asked.first_seq + 10, asked.next_seq);
      if (asked.first_seq < end) send(robot, asked.first_seq, end - asked.first_seq);
      asked.first_seq = std::max(asked.first_seq, end);
      ASSERT_LE(recorder_->queued_samples(), 500u);
    }
    clock_.run_for(100ms);
  }

  std::vector<TestRobot> robots_;
  std::map<station::BootId, Missing> asked_;
  int times_asked_ = 0;
};

// Robots that make twice what the queue takes: what is neither stored nor lost is none.
TEST_F(OverloadTest, AtTwiceTheCapacityWhatIsMadeIsStoredOrLost) {
  begin(10);
  for (int tenth = 0; tenth < 100; ++tenth) ASSERT_NO_FATAL_FAILURE(pass(10));
  EXPECT_GT(recorder_->counters().samples_refused, 1000u);
  EXPECT_GT(recorder_->counters().samples_lost, 100u);
  const std::uint64_t lost = recorder_->counters().samples_lost;
  for (int tenth = 0; tenth < 100; ++tenth) ASSERT_NO_FATAL_FAILURE(pass(0));
  flush();
  EXPECT_GE(times_asked_, 10);
  for (const TestRobot& robot : robots_) EXPECT_EQ(durable_next_seqs_[robot.boot_id], robot.next_seq) << robot.id;
  const auto& counters = recorder_->counters();
  EXPECT_EQ(counters.samples_lost, lost) << "what the rings held was asked for and came";
  EXPECT_EQ(counters.samples_written + counters.samples_lost, 10'000u);
  EXPECT_EQ(number("SELECT sum(last_seq - first_seq + 1) FROM segment"),
            static_cast<std::int64_t>(counters.samples_written));
  EXPECT_EQ(number("SELECT sum(last_seq - first_seq + 1) FROM gap"), static_cast<std::int64_t>(counters.samples_lost));
  EXPECT_EQ(number("SELECT count(*) FROM gap WHERE cause = 'queue_full'") > 0, true);
}

}  // namespace
}  // namespace server
