// Every sample that is acknowledged is stored once, in its place; what is lost is listed.
#include "tests/server/recording/recorder_fixture.hpp"

namespace server {
namespace {

class RecorderTest : public RecorderFixture {};

TEST_F(RecorderTest, StoresAFullGroupAtTheNextCommitAndAcknowledgesIt) {
  start();
  connect(robot_);
  make(robot_, 100);
  EXPECT_TRUE(clock_.run_until([&] { return durable_next_seq_ == 100; }, 150ms));
  EXPECT_EQ(segments(), Rows{"0|99"});
  EXPECT_EQ(rows("SELECT row, position_m FROM sample WHERE row IN (1, 100)"),
            (Rows{"1|0.0", "100|0.0989999994635582"}));
}

TEST_F(RecorderTest, StoresASmallGroupWhenItIsALittleOverASecondOld) {
  start();
  connect(robot_);
  make(robot_, 7);
  clock_.run_for(1s);
  EXPECT_EQ(durable_next_seq_, 0u);
  clock_.run_for(250ms);
  EXPECT_EQ(durable_next_seq_, 7u);
  EXPECT_EQ(segments(), Rows{"0|6"});
}

TEST_F(RecorderTest, StoresASegmentsTimesAndExtremes) {
  start();
  connect(robot_);
  make(robot_, 100);
  flush();
  EXPECT_EQ(rows("SELECT first_robot_time_us, period_us, utc_offset_us, clock_uncertainty_us, mode, setpoint_m,"
                 " min_position_m, round(max_position_m, 6), max_impedance_mv FROM segment"),
            Rows{"500000|10000|1700000000000000|300|manual||0.0|0.099|175.0"});
}

TEST_F(RecorderTest, BeginsASegmentWhenAnyPerBatchValueChanges) {
  start();
  connect(robot_);
  make(robot_, 10);
  robot_.context.setpoint_m = 0.1F;
  make(robot_, 10);
  robot_.context.mode = rheonaut_MODE_AUTO;
  make(robot_, 10);
  robot_.context.flags = rheonaut_TelemetryFlag_TELEMETRY_FLAG_SATURATED;
  make(robot_, 10);
  flush();
  EXPECT_EQ(segments(), (Rows{"0|9", "10|19", "20|29", "30|39"}));
}

TEST_F(RecorderTest, BeginsASegmentWhenTimeSteps) {
  start();
  connect(robot_);
  make(robot_, 10);
  station::SampleBatch late = robot_.batch(10, 5);
  late.first_robot_time_us += 50;  // jitter of a tick
  send(robot_, late);
  late = robot_.batch(15, 5);
  late.first_robot_time_us += 5000;
  send(robot_, late);
  late = robot_.batch(20, 5);
  late.first_robot_time_us += 5000;
  late.utc_offset_us += 3'600'000'000;  // somebody set the station's clock
  send(robot_, late);
  flush();
  EXPECT_EQ(segments(), (Rows{"0|14", "15|19", "20|24"}));
  EXPECT_EQ(rows("SELECT first_robot_time_us FROM segment WHERE first_seq = 15"), Rows{"655000"});
}

TEST_F(RecorderTest, NoSegmentIsLongerThan100Samples) {
  start();
  connect(robot_);
  make(robot_, 250, 25);
  flush();
  EXPECT_EQ(segments(), (Rows{"0|99", "100|199", "200|249"}));
}

TEST_F(RecorderTest, DropsDuplicatesOfStoredAndOfWaitingSamples) {
  start();
  connect(robot_);
  make(robot_, 50);
  flush();
  make(robot_, 10);
  send(robot_, 40, 25);  // 40..49 stored, 50..59 wait, 60..64 new
  flush();
  EXPECT_EQ(segments(), (Rows{"0|49", "50|64"}));
  EXPECT_EQ(samples(), 65);
  EXPECT_EQ(recorder_->counters().samples_duplicate, 20u);
}

TEST_F(RecorderTest, DropsDuplicatesWhileACommitIsUnderWay) {
  start();
  connect(robot_);
  send(robot_, 0, 10);
  auto flushing = [](storage::Recorder& recorder) -> boost::asio::awaitable<void> { co_await recorder.flush(); };
  tasks_->spawn("flush", flushing(*recorder_));
  while (disk_.jobs() == 0) loop_.poll_one();
  send(robot_, 5, 10);
  flush();
  EXPECT_EQ(segments(), (Rows{"0|9", "10|14"}));
}

TEST_F(RecorderTest, AcknowledgesUpToTheFirstHoleAndPassesItWhenBackfilled) {
  start();
  connect(robot_);
  send(robot_, 0, 10);
  send(robot_, 50, 10);
  flush();
  EXPECT_EQ(durable_next_seq_, 10u);
  send(robot_, 10, 20);  // backfill and live samples come in turns
  send(robot_, 60, 5);
  send(robot_, 30, 20);
  send(robot_, 65, 5);
  flush();
  EXPECT_EQ(durable_next_seq_, 70u);
  EXPECT_EQ(segments(), (Rows{"0|9", "10|49", "50|59", "60|69"}));
  EXPECT_EQ(samples(), 70);
}

TEST_F(RecorderTest, WhatTheRobotNoLongerHoldsIsAGapAndIsPassed) {
  start();
  connect(robot_);
  send(robot_, 0, 10);
  robot_.oldest_seq = 25;
  send(robot_, 30, 10);
  flush();
  EXPECT_EQ(gaps(), Rows{"10|24|ring_overrun"});
  EXPECT_EQ(durable_next_seq_, 25u);
  send(robot_, 25, 5);
  flush();
  EXPECT_EQ(durable_next_seq_, 40u);
  EXPECT_EQ(recorder_->counters().samples_lost, 15u);
}

TEST_F(RecorderTest, AGapBelowTheHelloIsStoredOnceConnected) {
  robot_.next_seq = 900;
  robot_.oldest_seq = 100;
  start();
  connect(robot_);
  flush();
  EXPECT_EQ(gaps(), Rows{"0|99|ring_overrun"});
  EXPECT_EQ(durable_next_seq_, 100u);
}

TEST_F(RecorderTest, AsksForAHoleThatDoesNotShrinkOnceASecond) {
  start();
  connect(robot_);
  send(robot_, 0, 10);
  send(robot_, 20, 10);
  clock_.run_for(400ms);
  EXPECT_TRUE(missing_.empty());
  clock_.run_for(300ms);
  EXPECT_EQ(missing_, (std::vector<Missing>{{10, 20}}));
  clock_.run_for(1s);
  EXPECT_EQ(missing_, (std::vector<Missing>{{10, 20}, {10, 20}}));
  send(robot_, 10, 10);
  clock_.run_for(5s);
  EXPECT_EQ(missing_.size(), 2u);
}

TEST_F(RecorderTest, AsksNothingOfARobotThatIsNotConnected) {
  start();
  connect(robot_);
  send(robot_, 10, 10);
  disconnect(robot_);
  clock_.run_for(5s);
  EXPECT_TRUE(missing_.empty());
}

TEST_F(RecorderTest, AcknowledgedSamplesSurviveAKillAndTheRestIsAskedFor) {
  start();
  connect(robot_);
  make(robot_, 100);
  clock_.run_for(200ms);
  make(robot_, 40);
  const std::uint64_t acknowledged = durable_next_seq_;
  kill();
  start();
  ASSERT_EQ(restored_.robots.size(), 1u);
  EXPECT_EQ(restored_.robots[0].id, "nemo");
  EXPECT_EQ(admit(robot_).durable_next_seq, acknowledged);
  connect(robot_);
  make(robot_, 10);
  send(robot_, acknowledged, 140 - acknowledged);
  flush();
  EXPECT_EQ(samples(), 150);
  EXPECT_EQ(number("SELECT count(DISTINCT row) FROM sample"), 150);
  EXPECT_EQ(durable_next_seq_, 150u);
}

TEST_F(RecorderTest, CloseWritesEverythingThatWasReceived) {
  start();
  connect(robot_);
  make(robot_, 33);
  stop();
  EXPECT_FALSE(std::filesystem::exists(path_.string() + "-wal"));
  EXPECT_EQ(samples(), 33);
}

TEST_F(RecorderTest, RowsAreNumberedOnAcrossRestarts) {
  start();
  connect(robot_);
  make(robot_, 10);
  stop();
  start();
  connect(robot_);
  make(robot_, 10);
  flush();
  EXPECT_EQ(rows("SELECT first_row, last_row FROM segment"), (Rows{"1|10", "11|20"}));
}

TEST_F(RecorderTest, EventsAreStoredOnceWithTheNextCommit) {
  start();
  connect(robot_);
  send_event(robot_, 0);
  send_event(robot_, 1);
  send_event(robot_, 1);
  EXPECT_TRUE(clock_.run_until([&] { return durable_next_event_seq_ == 2; }, 110ms));
  EXPECT_EQ(rows("SELECT event_seq, kind, mode FROM event"), (Rows{"0|mode_changed|auto", "1|mode_changed|auto"}));
  send_event(robot_, 5, 4);
  flush();
  EXPECT_EQ(rows("SELECT first_event_seq, last_event_seq FROM event_gap"), Rows{"2|3"});
  EXPECT_EQ(durable_next_event_seq_, 4u);
  kill();
  start();
  EXPECT_EQ(admit(robot_).durable_next_event_seq, 4u);
}

TEST_F(RecorderTest, AsksForMissingEventsOnceASecond) {
  start();
  connect(robot_);
  send_event(robot_, 0);
  send_event(robot_, 2);
  clock_.run_for(400ms);
  EXPECT_EQ(missing_events_, 0);
  clock_.run_for(1400ms);
  EXPECT_EQ(missing_events_, 2);
  send_event(robot_, 1);
  clock_.run_for(5s);
  EXPECT_EQ(missing_events_, 2);
  EXPECT_EQ(durable_next_event_seq_, 3u);
}

TEST_F(RecorderTest, SegmentsOfEachBootEndAtItsOwnSamples) {
  start();
  connect(robot_);
  make(robot_, 30);
  flush();  // cuts the segment; the next one ends where it would have ended
  make(robot_, 270);
  TestRobot other;
  other.id = "dory";
  other.boot_id = 7;
  connect(other);
  make(other, 200);
  flush();
  EXPECT_EQ(rows("SELECT boot_key, first_seq, last_seq FROM segment ORDER BY boot_key, first_seq"),
            (Rows{"1|0|29", "1|30|99", "1|100|199", "1|200|299", "2|0|62", "2|63|162", "2|163|199"}));
}

TEST_F(RecorderTest, WhatComesAfterACompleteSegmentWaitsForItsOwn) {
  start();
  connect(robot_);
  make(robot_, 103);
  clock_.run_for(200ms);
  EXPECT_EQ(durable_next_seq_, 100u);
  make(robot_, 97);
  clock_.run_for(100ms);
  EXPECT_EQ(segments(), (Rows{"0|99", "100|199"}));
}

TEST_F(RecorderTest, ASegmentsUncertaintyHoldsForEachOfItsBatches) {
  start();
  connect(robot_);
  station::SampleBatch batch = robot_.batch(0, 5);  // 300 µs
  send(robot_, batch);
  batch = robot_.batch(5, 5);
  batch.utc_offset_us -= 400;
  batch.clock_uncertainty_us = 200;
  send(robot_, batch);
  batch = robot_.batch(10, 5);
  batch.utc_offset_us += 100;
  batch.clock_uncertainty_us = 50;
  send(robot_, batch);
  flush();
  EXPECT_EQ(rows("SELECT utc_offset_us, clock_uncertainty_us FROM segment"), Rows{"1700000000000000|600"});
}

TEST_F(RecorderTest, HowFarABootIsDurableIsStoredWithIt) {
  const auto stored = [this] { return rows("SELECT durable_next_seq, durable_next_event_seq FROM boot"); };
  start();
  connect(robot_);
  send(robot_, 0, 10);
  send(robot_, 20, 10);
  send_event(robot_, 0);
  send_event(robot_, 2);
  flush();
  EXPECT_EQ(stored(), Rows{"10|1"});
  robot_.oldest_seq = 15;
  send(robot_, 15, 5);
  send_event(robot_, 3, 2);
  flush();
  EXPECT_EQ(stored(), Rows{"30|4"});
}

TEST_F(RecorderTest, RestoresPendingStopsAndEndsOtherCommands) {
  start();
  send_command(0xffffffffffffffff, "emergency_stop", station::CommandState::queued);
  send_command(0xffffffffffffffff, "emergency_stop", station::CommandState::sent);
  send_command(2, "emergency_stop", station::CommandState::acknowledged);
  send_command(3, "set_duty", station::CommandState::sent);
  send_command(4, "set_duty", station::CommandState::queued);
  flush();
  kill();
  start();
  ASSERT_EQ(restored_.pending_stops.size(), 1u);
  EXPECT_EQ(restored_.pending_stops[0].id, 0xffffffffffffffff);
  EXPECT_EQ(restored_.pending_stops[0].state, station::CommandState::sent);
  EXPECT_EQ(rows("SELECT state, reason FROM command WHERE command_id = 3"), Rows{"unknown|station_restarted"});
  EXPECT_EQ(rows("SELECT state, reason FROM command WHERE command_id = 4"), Rows{"failed|station_restarted"});
}

TEST_F(RecorderTest, CountsABatchOfABootThatIsNotRecorded) {
  start();
  send(robot_, 0, 5);
  flush();
  EXPECT_EQ(samples(), 0);
  EXPECT_EQ(recorder_->counters().batches_malformed, 1u);
}

TEST_F(RecorderTest, ABootThatConnectsAgainAndAgainAddsNoRow) {
  start();
  connect(robot_);
  make(robot_, 10);
  disconnect(robot_);
  flush();
  const auto all_rows = [this] {
    std::vector<std::string> counts;
    for (const std::string& table : rows("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")) {
      counts.push_back(table + " " + std::to_string(number("SELECT count(*) FROM " + table)));
    }
    return counts;
  };
  const std::vector<std::string> before = all_rows();
  for (int n = 0; n < 100; ++n) {
    connect(robot_);
    disconnect(robot_);
    clock_.run_for(200ms);
  }
  flush();
  EXPECT_EQ(all_rows(), before);
}

TEST_F(RecorderTest, KeepsNoBookkeepingOfBootsThatAreGone) {
  start();
  connect(robot_);
  make(robot_, 10);
  disconnect(robot_);
  clock_.run_for(120s);
  EXPECT_EQ(recorder_->next_seq(robot_.boot_id), 0u);
  const std::int64_t before_us = clock_.steady_us();
  for (int i = 0; i < 3; ++i) clock_.advance_to_next();
  EXPECT_GE(clock_.steady_us() - before_us, 5'000'000);  // only the watch of the disk wakes up, each 5 s
  connect(robot_);
  make(robot_, 10);
  flush();
  EXPECT_EQ(samples(), 20);
}

}  // namespace
}  // namespace server
