// What waits to be stored can be read as if it were, and one boot can be stored without the others.
#include <gmock/gmock.h>

#include <bit>
#include <limits>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

constexpr storage::Interval kAll{0, std::numeric_limits<std::uint64_t>::max()};

class WaitingTest : public RecordingTest {
 protected:
  WaitingTest() {
    other_.id = "dory";
    other_.boot_id = 7;
  }

  std::vector<std::string> waiting(const TestRobot& robot, storage::Interval range = kAll) {
    std::vector<std::string> parts;
    for (const storage::Segment& segment : recorder_->waiting(robot.boot_id, range)) {
      EXPECT_EQ(segment.samples.front().position_m, static_cast<float>(segment.first_seq) / 1000);
      EXPECT_EQ(segment.first_robot_time_us, robot.time_of(segment.first_seq));
      parts.push_back(std::to_string(segment.first_seq) + "-" + std::to_string(segment.next_seq() - 1));
    }
    return parts;
  }

  std::vector<std::string> waiting_gaps(const TestRobot& robot) {
    std::vector<std::string> parts;
    for (const storage::LostRange& gap : recorder_->waiting_gaps(robot.boot_id, kAll)) {
      parts.push_back(std::to_string(gap.lost.first) + "-" + std::to_string(gap.lost.next - 1) + " " + gap.cause);
    }
    return parts;
  }

  std::int64_t stored(const TestRobot& robot) {
    return number(
        "SELECT coalesce(sum(last_seq - first_seq + 1), 0) FROM segment JOIN boot USING (boot_key)"
        " WHERE robot_id = '" +
        robot.id + "'");
  }

  TestRobot robot_;
  TestRobot other_;
};

using Parts = std::vector<std::string>;

TEST_F(WaitingTest, SamplesWaitUntilTheyAreDurable) {
  start();
  connect(robot_);
  connect(other_);
  EXPECT_EQ(waiting(robot_), Parts{});
  make(robot_, 30);
  make(other_, 10);
  EXPECT_EQ(waiting(robot_), Parts{"0-29"});
  EXPECT_EQ(waiting(other_), Parts{"0-9"});
  flush();
  EXPECT_EQ(waiting(robot_), Parts{});
  EXPECT_EQ(stored(robot_), 30);
}

TEST_F(WaitingTest, TheyAreCutToTheRangeAndAscending) {
  start();
  connect(robot_);
  send(robot_, 200, 30);
  send(robot_, 0, 120);
  EXPECT_EQ(waiting(robot_), (Parts{"0-99", "100-119", "200-229"}));
  EXPECT_EQ(waiting(robot_, {90, 205}), (Parts{"90-99", "100-119", "200-204"}));
  EXPECT_EQ(waiting(robot_, {120, 200}), Parts{});
  EXPECT_EQ(waiting(robot_, {50, 50}), Parts{});
}

TEST_F(WaitingTest, WhatTheDiskDoesNotTakeGoesOnWaiting) {
  start();
  connect(robot_);
  flush();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
  foreign.exec("BEGIN IMMEDIATE");
  make(robot_, 100);
  ASSERT_TRUE(clock_.run_until([&] { return recorder_->failing(); }, 3s));
  make(robot_, 5);
  EXPECT_EQ(waiting(robot_), (Parts{"0-99", "100-104"}));
  foreign.exec("ROLLBACK");
  clock_.run_for(3s);
  EXPECT_EQ(waiting(robot_), Parts{});
  EXPECT_EQ(stored(robot_), 105);
}

// Hours may wait: a page asks for no more than it can hold.
TEST_F(WaitingTest, APageGetsTheFirstOfWhatWaits) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  flush();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
  foreign.exec("BEGIN IMMEDIATE");
  make(robot_, 30'000, 25);
  ASSERT_TRUE(clock_.run_until([&] { return recorder_->failing(); }, 3s));
  EXPECT_EQ(recorder_->waiting(robot_.boot_id, kAll, 150).back().next_seq(), 200u);
  EXPECT_EQ(recorder_->waiting(robot_.boot_id, {1'050, 30'000}, 1).back().next_seq(), 1'100u);

  const auto waiting_in = [](const std::vector<storage::RecordedSpan>& spans) {
    std::size_t samples = 0;
    for (const storage::Segment& segment : spans.at(0).waiting) samples += segment.samples.size();
    return samples;
  };
  EXPECT_LE(waiting_in(wait(history_->spans(storage::excerpt_of(run), storage::SampleCursor{0, 999}, 500)).value()),
            600u);
  EXPECT_EQ(waiting_in(wait(history_->spans(storage::excerpt_of(run))).value()), 30'000u);

  std::uint64_t next_seq = 0;
  std::optional<storage::SampleCursor> after;
  do {
    const storage::SamplePage page = wait(history_->samples(run, after, 7'001)).value();
    for (const storage::StoredSample& stored : page.samples) ASSERT_EQ(stored.seq, next_seq++);
    after = page.next;
    if (next_seq == 14'002) {  // the next pages join what is stored with what waits
      foreign.exec("ROLLBACK");
      clock_.run_for(2s);
      make(robot_, 50);
    }
  } while (after);
  EXPECT_EQ(next_seq, 30'050u);
}

// While the disk fails some ask, give up and go; nothing is kept of them. Each waits 3 s for SQLite, in real time.
TEST_F(WaitingTest, WhoGaveUpWaitingForTheDiskIsForgotten) {
  start();
  connect(robot_);
  flush();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
  foreign.exec("BEGIN IMMEDIATE");
  make(robot_, 100);
  ASSERT_TRUE(clock_.run_until([&] { return recorder_->failing(); }, 3s));
  for (int asked = 0; asked < 3; ++asked) EXPECT_FALSE(wait(recorder_->flush_records()));
  EXPECT_LE(recorder_->flushes(), 1u);
  foreign.exec("ROLLBACK");
  clock_.run_for(3s);
  EXPECT_EQ(recorder_->flushes(), 0u);
}

TEST_F(WaitingTest, GapsWaitToo) {
  start();
  connect(robot_);
  robot_.oldest_seq = robot_.next_seq = 20;
  make(robot_, 5);
  EXPECT_EQ(waiting_gaps(robot_), Parts{"0-19 ring_overrun"});
  EXPECT_EQ(waiting_gaps(other_), Parts{});
  flush();
  EXPECT_EQ(waiting_gaps(robot_), Parts{});
}

TEST_F(WaitingTest, AnUnknownBootHasNothingWaiting) {
  start();
  EXPECT_EQ(waiting(robot_), Parts{});
  EXPECT_EQ(waiting_gaps(robot_), Parts{});
  EXPECT_TRUE(wait(recorder_->flush(robot_.boot_id)));
}

// Bit for bit, also what SQLite cannot hold: NaN's other forms, infinities and the negative zero.
TEST_F(WaitingTest, ValuesAreThoseThatWillBeReadBack) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  station::SampleBatch batch = robot_.batch(0, 2);
  batch.samples[0] = {-0.0F, kInfinity, -kInfinity, std::numeric_limits<float>::quiet_NaN(), 0.1F, 1e-40F};
  batch.samples[1] = {std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::max(), 1, -1, 1.0F / 3, 3};
  send(robot_, batch);
  const auto bits = [&] {
    std::vector<std::uint32_t> found;
    for (const storage::StoredSample& stored : wait(history_->samples(run, std::nullopt, 10))->samples) {
      const station::Sample& sample = stored.sample;
      for (const float value : {sample.position_m, sample.velocity_m_s, sample.acceleration_m_s2, sample.duty,
                                sample.impedance_mv, sample.reference_m}) {
        found.push_back(std::bit_cast<std::uint32_t>(value));
      }
    }
    return found;
  };
  ASSERT_EQ(stored(robot_), 0);
  const std::vector<std::uint32_t> while_waiting = bits();
  ASSERT_EQ(stored(robot_), 0);
  EXPECT_EQ(while_waiting.size(), 12u);
  flush();
  EXPECT_EQ(bits(), while_waiting);
}

TEST_F(WaitingTest, AFlushOfOneBootLeavesTheSegmentsOfOthersWhole) {
  start();
  connect(robot_);
  connect(other_);
  flush();
  make(robot_, 30);
  make(other_, 30);
  EXPECT_TRUE(wait(recorder_->flush(robot_.boot_id)));
  EXPECT_EQ(stored(robot_), 30);
  EXPECT_EQ(stored(other_), 0);
  EXPECT_EQ(waiting(other_), Parts{"0-29"});
  const auto commits = recorder_->counters().commits;
  EXPECT_TRUE(wait(recorder_->flush(robot_.boot_id)));  // nothing of it waits
  EXPECT_EQ(recorder_->counters().commits, commits);
  EXPECT_EQ(stored(other_), 0);
}

TEST_F(WaitingTest, AFlushOfBootsWritesOnlyWhenOneHasConnected) {
  start();
  connect(robot_);
  EXPECT_EQ(number("SELECT count(*) FROM boot WHERE connected_at_us IS NOT NULL"), 0);
  EXPECT_TRUE(wait(recorder_->flush_boots()));
  EXPECT_EQ(number("SELECT count(*) FROM boot WHERE connected_at_us IS NOT NULL"), 1);
  make(robot_, 5);
  const auto commits = recorder_->counters().commits;
  EXPECT_TRUE(wait(recorder_->flush_boots()));
  EXPECT_EQ(recorder_->counters().commits, commits);
}

TEST_F(WaitingTest, TheFirstAndTheLastArrivalOfASegmentAreStored) {
  start();
  connect(robot_);
  const std::int64_t first_us = clock_.utc_us();
  make(robot_, 5);
  clock_.run_for(50ms);
  make(robot_, 5);
  const std::vector<storage::Segment> segments = recorder_->waiting(robot_.boot_id, kAll);
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].first_received_at_us, first_us);
  EXPECT_EQ(segments[0].received_at_us, 0) << "others may follow";
  flush();
  EXPECT_EQ(number("SELECT first_received_at_us FROM segment"), first_us);
  EXPECT_EQ(number("SELECT received_at_us FROM segment"), first_us + 50'000);
}

}  // namespace
}  // namespace server
