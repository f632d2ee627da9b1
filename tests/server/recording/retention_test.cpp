// What is too old or too much goes, whole segments at a time; a run, and what is not durable, stays.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "tests/server/recording/retention_fixture.hpp"

namespace server {
namespace {

using ::testing::IsEmpty;

TEST_F(RetentionTest, RemovesWhatIsOldAndListsItAsAGap) {
  keep(7);
  record(1000);
  age(8 * kDay);
  record(500);
  pass();
  EXPECT_EQ(gaps(), Rows{"0|999|retention"});
  EXPECT_EQ(samples(), 500);
  EXPECT_EQ(counters().samples_purged, 1000U);
  EXPECT_NEAR(static_cast<double>(number("SELECT noticed_at_us FROM gap")), static_cast<double>(clock_.utc_us()), 1e6);
  EXPECT_EQ(recorder_->counters().samples_lost, 0U) << "what was removed was not lost";
}

TEST_F(RetentionTest, WhatAnEarlierStartStoredGoesByItsTimeOfArrival) {
  keep(7);
  record(1000);
  stop();
  clock_.step_utc(8 * kDay);
  keep(7);
  record(500);
  pass();
  EXPECT_EQ(gaps(), Rows{}) << "the clock may be wrong, until it has stood by that for a day of running";
  EXPECT_TRUE(recording_->removal_clock.is_doubted());
  recording_->removal_clock.accept();
  pass();
  EXPECT_EQ(gaps(), Rows{"0|999|retention"});
}

// The clock was wrong, e.g. on a machine without a battery, and then it was set.
TEST_F(RetentionTest, AClockThatIsSetMakesNothingOld) {
  keep(7);
  record(1000);
  start_again(7);
  record(1000);
  clock_.step_utc(400 * kDay);
  record(1000);
  pass();
  EXPECT_EQ(samples(), 3000);
  age(8 * kDay);
  record(100);
  pass();
  EXPECT_EQ(gaps(), Rows{"0|2999|retention"}) << "in time they do get old";
}

TEST_F(RetentionTest, AClockThatWasFarAheadHoldsNothingBack) {
  clock_.step_utc(400 * kDay);
  keep(7);
  record(1000);
  stop();
  clock_.step_utc(-400 * kDay);
  keep(7);
  record(500);
  pass();
  EXPECT_EQ(samples(), 1500);
  age(8 * kDay);
  record(500);
  pass();
  EXPECT_EQ(gaps(), Rows{"0|1499|retention"});
}

TEST_F(RetentionTest, WithoutAPolicyEverythingStays) {
  keep(0);
  record(1000);
  age(10'000 * kDay);
  pass();
  EXPECT_EQ(samples(), 1000);
}

TEST_F(RetentionTest, WorksByItself) {
  keep(7);
  record(1000);
  age(8 * kDay);
  record(500);
  clock_.run_for(40s);
  EXPECT_EQ(samples(), 500);
}

TEST_F(RetentionTest, ARunHoldsItsSamplesUntilItIsDiscarded) {
  keep(7);
  record(250);
  const storage::RunId run = wait(runs_->create(robot_.id, named("kept")))->id;
  record(300);
  ASSERT_TRUE(wait(runs_->end(run, "good")));
  record(450);
  age(8 * kDay);
  record(500);
  const auto before = runs();
  ASSERT_EQ(before.at(run).size(), 301U);
  pass();
  EXPECT_EQ(runs(), before);
  EXPECT_EQ(gaps(), (Rows{"0|249|retention", "550|999|retention"}));

  execute(fmt::format("UPDATE run SET state = 'discarded' WHERE run_id = {}", run));
  pass();
  EXPECT_EQ(gaps(), Rows{"0|999|retention"}) << "with its neighbours it is one gap";
}

TEST_F(RetentionTest, ASegmentThatARunHoldsInPartStaysWhole) {
  keep(7);
  record(1000);
  age(8 * kDay);
  record(500);
  execute(
      "INSERT INTO run (robot_id, name, fluid, pump_profile, tube, operator_name, notes, verdict, firmware_version,"
      " controller_id, controller_checksum, parameters_checksum, started_at_us, ended_at_us, state)"
      " VALUES ('nemo', 'afterwards', '', '', '', '', '', '', '', 0, 0, 0, 0, 0, 'ended');"
      "INSERT INTO run_span (run_id, span, boot_key, first_seq, last_seq) VALUES (1, 0, 1, 350, 420)");
  pass();
  EXPECT_EQ(gaps(), (Rows{"0|299|retention", "500|999|retention"}));
  EXPECT_EQ(number("SELECT count(*) FROM run_sample WHERE run_id = 1"), 71);
}

TEST_F(RetentionTest, AnOpenRunHoldsEverythingFromItsFirstSampleOn) {
  keep(7);
  record(300);
  ASSERT_TRUE(wait(runs_->create(robot_.id, named("open"))));
  record(700);
  age(8 * kDay);
  record(500);
  pass();
  EXPECT_EQ(gaps(), Rows{"0|299|retention"});
}

TEST_F(RetentionTest, NothingGoesThatIsNotDurableWithAllBeforeIt) {
  keep(7);
  record(1000);
  set_durable(robot_.boot_id, 450);
  age(8 * kDay);
  pass();
  EXPECT_EQ(gaps(), Rows{"0|399|retention"});
}

TEST_F(RetentionTest, GapsOfOtherCausesKeepTheirRows) {
  keep(7);
  record(200);
  robot_.next_seq = robot_.oldest_seq = 250;  // its ring lost 50
  record(300);
  age(8 * kDay);
  record(500);
  pass();
  EXPECT_EQ(gaps(), (Rows{"0|199|retention", "200|249|ring_overrun", "250|549|retention"}));
}

// A gap row stands for what was removed, so the boot reads the same to the robot.
TEST_F(RetentionTest, ARobotThatReconnectsAfterARestartReceivesTheSameAsBefore) {
  keep(7);
  record(1000);
  age(8 * kDay);
  record(500);
  pass();
  ASSERT_EQ(durable_next_seq_, 1500U);
  stop();
  start();
  robot_.oldest_seq = 1400;
  EXPECT_EQ(admit(robot_).durable_next_seq, 1500U);
  connect(robot_);
  record(100);
  clock_.run_for(5s);
  EXPECT_EQ(durable_next_seq_, 1600U);
  EXPECT_THAT(missing_, IsEmpty());
  EXPECT_EQ(gaps(), Rows{"0|999|retention"});
}

TEST_F(RetentionTest, ABootThatHasEndedGoesToItsLastSample) {
  keep(7);
  record(1000);
  disconnect(robot_);
  robot_.boot_id += 1;
  robot_.next_seq = 0;
  connect(robot_);
  record(100);
  age(8 * kDay);
  pass();
  EXPECT_EQ(gaps().front(), "0|999|retention");
  EXPECT_EQ(number("SELECT count(*) FROM segment"), 1) << "the newest one of the boot that goes on";
}

// SAFETY: a station that starts again must know that a robot is latched.
TEST_F(RetentionTest, ALatchIsKnownAfterTheRestartAlsoWhenAllIsOld) {
  keep(7);
  robot_.context.emergency_id = 4711;
  record(1000);
  age(8 * kDay);
  pass();
  ASSERT_EQ(samples(), 100);
  stop();
  start();
  ASSERT_EQ(restored_.robots.size(), 1U);
  EXPECT_EQ(restored_.robots.front().emergency_id, 4711U);
}

TEST_F(RetentionTest, ATooLargeDatabaseLosesItsOldestAndShrinks) {
  keep(0, 2);
  for (int hour = 0; hour < 10; ++hour) {
    record(10'000);
    clock_.skip(1h);
  }
  ASSERT_GT(number("PRAGMA page_count") * 4096, 2'500'000);
  pass();
  EXPECT_LE(number("PRAGMA page_count") * 4096, 2'000'000);
  EXPECT_GT(samples(), 35'000) << "not more than needed, in steps of a segment";
  EXPECT_THAT(gaps(), ::testing::SizeIs(1));
  EXPECT_EQ(rows("SELECT first_seq FROM gap"), Rows{"0"});
  EXPECT_GT(counters().pages_returned, 0U);
  EXPECT_FALSE(counters().all_held);
}

TEST_F(RetentionTest, TheOlderSamplesGoWhoseverTheyAre) {
  keep(0, 1);
  TestRobot other;
  other.id = "dory";
  other.boot_id = 7;
  connect(other);
  make(other, 22'000, 25);
  flush();
  clock_.skip(5h);
  record(20'000);
  pass();
  EXPECT_EQ(rows("SELECT robot_id, first_seq, cause FROM robot_gap"), Rows{"dory|0|retention"});
}

TEST_F(RetentionTest, WhatRunsHoldStaysAlsoWhenItIsTooMuch) {
  keep(0, 1);
  ASSERT_TRUE(wait(runs_->create(robot_.id, named("large"))));
  record(40'000);
  pass();
  EXPECT_EQ(samples(), 40'000);
  EXPECT_TRUE(counters().all_held);
}

TEST_F(RetentionTest, WhileTheDiskFailsNothingIsRemoved) {
  keep(7);
  record(1000);
  age(8 * kDay);
  record(500);
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
  foreign.exec("BEGIN IMMEDIATE");
  wait(recording_->retention.pass());
  EXPECT_EQ(counters().samples_purged, 0U);
  foreign.exec("ROLLBACK");
  pass();
  EXPECT_EQ(samples(), 500);
}

}  // namespace
}  // namespace server
