// What may go goes in short steps, with commits in between; what has come to be held meanwhile stays.
#include "server/storage/upkeep/purge.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "tests/server/recording/retention_fixture.hpp"

namespace server {
namespace {

using ::testing::IsEmpty;

class PurgeTest : public RetentionTest {};

TEST_F(PurgeTest, SlicesOfAnySizeRemoveTheSame) {
  keep(0);
  record(1000);
  ASSERT_TRUE(wait(runs_->create(robot_.id, named("open"))));
  SQLite::Database database = storage::open_for_reading(path_);
  const auto seqs = [&](std::size_t limit) {
    std::vector<std::uint64_t> firsts;
    storage::RetentionPlan plan = planned();
    storage::RetentionPlan::Step step{plan, database};
    while (!plan.empty()) {
      for (const storage::StoredSegment& segment : step.next(limit)) firsts.push_back(segment.samples.first);
    }
    return firsts;
  };
  EXPECT_EQ(seqs(1000).size(), 9U) << "the newest of a boot that goes on stays";
  for (const std::size_t limit : {1U, 2U, 3U, 9U}) EXPECT_EQ(seqs(limit), seqs(1000)) << limit;
}

// Each look at it takes a while.
class TickingClock final : public runtime::Clock {
 public:
  explicit TickingClock(microseconds tick) : tick_us_{tick.count()} {}
  std::int64_t steady_us() const override { return steady_us_ += tick_us_; }
  std::int64_t utc_us() const override { return 0; }
  using runtime::Clock::sleep_until;
  boost::asio::awaitable<void> sleep_until(std::int64_t, Alarm*) override { co_return; }

 private:
  std::int64_t tick_us_;
  mutable std::int64_t steady_us_ = 0;
};

// However slow the disk has become: it is seen after 400 samples.
TEST_F(PurgeTest, AStepEndsByTheClock) {
  keep(0);
  record(20'000);
  for (const auto& [tick, removed] : std::vector<std::pair<microseconds, std::uint64_t>>{
           {1ms, 10 * 400}, {4ms, 3 * 400}, {10ms, 400}, {100ms, 400}}) {
    storage::RetentionPlan plan = planned();
    auto step = [&](storage::Database& database) { return purge_step(database.handle(), plan, TickingClock{tick}, 0); };
    EXPECT_EQ(wait(recorder_->on_disk(step)), removed) << tick.count();
  }
  storage::RetentionPlan plan = planned();
  auto step = [&](storage::Database& database) { return purge_step(database.handle(), plan, clock_, 0); };
  EXPECT_LE(wait(recorder_->on_disk(step)), 10'000U) << "and no transaction is large on a fast one";
  EXPECT_THAT(gaps(), ::testing::SizeIs(1));
}

TEST_F(PurgeTest, AStepThatGivesPagesBackEndsByTheClock) {
  keep(0);
  record(120'000);
  storage::RetentionPlan plan = planned();
  carry_out(plan);
  const std::int64_t free_before = number("PRAGMA freelist_count");
  ASSERT_GT(free_before, 500);
  const std::int64_t pages_before = number("PRAGMA page_count");
  std::uint64_t all = 0;
  for (const auto& [tick, expected] :
       std::vector<std::pair<microseconds, std::uint64_t>>{{1ms, 10 * 16}, {4ms, 3 * 16}, {10ms, 16}, {100ms, 16}}) {
    auto step = [&](storage::Database& database) {
      return storage::shrink_step(database.handle(), TickingClock{tick});
    };
    const std::uint64_t returned = wait(recorder_->on_disk(step));
    EXPECT_EQ(returned, expected) << tick.count();
    all += returned;
  }
  auto step = [&](storage::Database& database) { return storage::shrink_step(database.handle(), clock_); };
  const std::uint64_t returned = wait(recorder_->on_disk(step));
  EXPECT_EQ(returned, 256U) << "and no transaction is large on a fast one";
  EXPECT_EQ(number("PRAGMA freelist_count"), free_before - static_cast<std::int64_t>(all + returned));
  EXPECT_LE(number("PRAGMA page_count"), pages_before - static_cast<std::int64_t>(all + returned));
  EXPECT_EQ(rows("PRAGMA integrity_check"), Rows{"ok"});
}

TEST_F(PurgeTest, ARunMadeWhileAPurgeIsUnderWayHoldsItsSamples) {
  keep(0);
  record(2000);
  storage::RetentionPlan plan = planned();
  const Result<Run> made =
      wait(runs_->make_afterwards(robot_.id, named("in time"), storage::SeqSpan{robot_.boot_id, 650, 849}, {}));
  ASSERT_TRUE(made.has_value());
  const auto before = runs();
  carry_out(plan);
  EXPECT_EQ(runs(), before);
  EXPECT_EQ(gaps(), (Rows{"0|599|retention", "900|1899|retention"}));
}

TEST_F(PurgeTest, ARunThatComesToABootWhileAPurgeIsUnderWayHoldsIt) {
  keep(0);
  record(1000);
  const storage::RunId run = wait(runs_->create(robot_.id, named("open")))->id;
  storage::RetentionPlan plan = planned();
  execute(fmt::format("UPDATE run_span SET first_seq = 300 WHERE run_id = {}", run));
  carry_out(plan);
  EXPECT_THAT(gaps(), IsEmpty());
  pass();
}

// SAFETY: its newest segment shows whether the robot is latched.
TEST_F(PurgeTest, ABootThatComesBackWhileAPurgeIsUnderWayKeepsItsNewestSegment) {
  keep(0);
  record(1000);
  const TestRobot first = robot_;
  disconnect(robot_);
  robot_.boot_id += 1;
  robot_.next_seq = 0;
  connect(robot_);
  record(100);
  clock_.run_for(3s);  // until the recorder has forgotten the first one
  storage::RetentionPlan plan = planned();
  connect(first);
  wait(recorder_->flush_boots());
  carry_out(plan);
  EXPECT_EQ(number("SELECT max(last_seq) FROM segment WHERE boot_key = 1"), 999);
}

TEST_F(PurgeTest, AllBootsAreLookedAtAFewAtATime) {
  keep(7);
  for (int boot = 0; boot < 210; ++boot) {
    make(robot_, 10);
    disconnect(robot_);
    robot_.boot_id += 1;
    robot_.next_seq = 0;
    connect(robot_);
  }
  flush();
  SQLite::Database database = storage::open_for_reading(path_);
  storage::RetentionPlan plan{std::nullopt};
  EXPECT_TRUE(plan.look(database));
  EXPECT_FALSE(plan.look(database));
  age(8 * kDay);
  pass();
  EXPECT_EQ(samples(), 0);
  EXPECT_THAT(gaps(), ::testing::SizeIs(210));
}

TEST_F(PurgeTest, CommitsGoInBetween) {
  keep(7);
  record(200'000);
  age(8 * kDay);
  tasks_->spawn("pass", recording_->retention.pass());
  int commits = 0;
  for (; counters().samples_purged < 199'000; ++commits) {
    record(100);
    ASSERT_EQ(durable_next_seq_, 200'000U + static_cast<std::uint64_t>(commits + 1) * 100);
    clock_.run_for(5ms);
    ASSERT_LT(commits, 100);
  }
  EXPECT_GT(commits, 3);
  clock_.run_for(1s);
  SQLite::Database database = storage::open_for_reading(path_);
  EXPECT_THAT(coverage_faults(database), IsEmpty());
  EXPECT_EQ(gaps(), Rows{"0|199999|retention"});
}

TEST(SampleAges, KeepANoteForEachHundredthOfTheAge) {
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  storage::RemovalClock removal{clock};
  removal.begin({});
  storage::SampleAges ages{removal, microseconds{100h}.count()};
  EXPECT_FALSE(ages.limit().covers(1, 0)) << "nothing is known yet";
  ages.begin(1000);
  EXPECT_FALSE(ages.limit().covers(1000, 0));
  EXPECT_TRUE(ages.limit().covers(999, 0));
  for (int hour = 1; hour <= 300; ++hour) {
    clock.skip(1h);
    ages.note(1000 + hour);
    EXPECT_EQ(ages.limit().row, hour < 100 ? 0 : 900 + hour) << hour;
  }
}

// --- the time by which things grow old ---

struct RemovalClockTest : ::testing::Test {
  RemovalClockTest() { removal.begin({}); }
  void run(std::chrono::hours for_) { run(removal, for_); }
  void run(storage::RemovalClock& one, std::chrono::hours for_) {
    for (auto left = microseconds{for_}; left > 0s; left -= 5min) {
      clock.skip(5min);
      one.look();
    }
  }
  std::int64_t behind_us() const { return clock.utc_us() - removal.utc_us(); }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  storage::RemovalClock removal{clock};
};

TEST_F(RemovalClockTest, FollowsEveryStepBackAndASmallOneForwardAtTheNextStart) {
  clock.step_utc(microseconds{-1000h});
  removal.look();
  EXPECT_EQ(behind_us(), 0);
  clock.step_utc(microseconds{20h});
  removal.look();
  EXPECT_FALSE(removal.is_doubted());
  EXPECT_EQ(behind_us(), microseconds{20h}.count()) << "nothing grows old by a clock that is set";
  storage::RemovalClock next{clock};
  next.begin(removal.state());
  EXPECT_EQ(next.utc_us(), clock.utc_us());
}

TEST_F(RemovalClockTest, WaitsForADayOfRunningAfterAJumpForward) {
  clock.step_utc(microseconds{8 * 24h});
  EXPECT_EQ(behind_us(), microseconds{8 * 24h}.count()) << "also before anybody looks";
  run(23h);
  EXPECT_TRUE(removal.is_doubted());
  EXPECT_EQ(behind_us(), microseconds{8 * 24h}.count());
  run(2h);
  EXPECT_FALSE(removal.is_doubted());
  EXPECT_EQ(behind_us(), 0);
}

TEST_F(RemovalClockTest, AnotherJumpBeginsTheDayAnewAndAWayBackEndsIt) {
  clock.step_utc(microseconds{8 * 24h});
  run(23h);
  clock.step_utc(microseconds{8 * 24h});
  run(23h);
  EXPECT_TRUE(removal.is_doubted());
  clock.step_utc(microseconds{-16 * 24h});
  run(1h);
  EXPECT_FALSE(removal.is_doubted());
  EXPECT_EQ(behind_us(), 0);
}

TEST_F(RemovalClockTest, ADayOfRunningCountsOverStarts) {
  clock.step_utc(microseconds{8 * 24h});
  run(13h);
  storage::RemovalClock next{clock};
  next.begin(removal.state());
  EXPECT_TRUE(next.is_doubted());
  run(next, 12h);
  EXPECT_FALSE(next.is_doubted());
}

TEST_F(RemovalClockTest, AnotherWrongClockAfterARestartBeginsTheDayAnew) {
  clock.step_utc(microseconds{8 * 24h});
  run(23h);
  const storage::RemovalClock::State before = removal.state();
  clock.step_utc(microseconds{3000 * 24h});
  storage::RemovalClock next{clock};
  next.begin(before);
  run(next, 2h);
  EXPECT_TRUE(next.is_doubted());
}

TEST_F(RemovalClockTest, TimeAsleepIsNoRunning) {
  clock.step_utc(microseconds{8 * 24h});
  removal.look();
  clock.skip(30h);
  removal.look();
  EXPECT_TRUE(removal.is_doubted());
}

TEST_F(RemovalClockTest, AClockThatGoesBackToAnotherWrongTimeBeginsTheDayAnew) {
  clock.step_utc(microseconds{300 * 24h});
  run(23h);
  clock.step_utc(microseconds{-280 * 24h});
  run(2h);
  EXPECT_TRUE(removal.is_doubted());
}

TEST_F(RemovalClockTest, AJumpBetweenTwoStartsIsOneToo) {
  const storage::RemovalClock::State before = removal.state();
  clock.step_utc(microseconds{8 * 24h});
  storage::RemovalClock next{clock};
  next.begin(before);
  EXPECT_TRUE(next.is_doubted());
  next.accept();
  EXPECT_FALSE(next.is_doubted());
  EXPECT_EQ(next.utc_us(), clock.utc_us());
}

}  // namespace
}  // namespace server
