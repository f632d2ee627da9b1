// What verify finds: nothing in a good database, and each kind of damage by name.
#include "server/storage/upkeep/store_check.hpp"

#include <gmock/gmock.h>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class StoreCheckTest : public RecordingTest {
 protected:
  // Run 1: 250 samples and a gap of 10 of one boot, 30 of the next; run 2: 100 samples after it. The station has ended.
  void SetUp() override {
    TestRobot robot;
    start();
    connect(robot);
    const storage::RunId first = begin(robot);
    make(robot, 200);
    robot.next_seq += 10;
    make(robot, 50);
    disconnect(robot);
    robot.boot_id += 1;
    robot.next_seq = robot.oldest_seq = 0;
    connect(robot);
    make(robot, 30);
    end(first);
    const storage::RunId second = begin(robot);
    make(robot, 100);
    end(second);
    stop();
  }
  storage::RunId begin(const TestRobot& robot) { return wait(runs_->create(robot.id, named("checked")))->id; }
  void end(storage::RunId run) {
    ASSERT_TRUE(wait(runs_->end(run, "")).has_value());
    ASSERT_TRUE(wait(recording_->digester.find(run))->is_final);
  }
  void damage(const std::string& sql) {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
    database.exec("PRAGMA foreign_keys = OFF; PRAGMA ignore_check_constraints = ON");
    database.exec(sql);
  }
  storage::StoreFindings findings(const storage::StoreCheck& options = {}) {
    SQLite::Database database = storage::open_for_reading(path_);
    return check_store(database, options).value();
  }
  std::vector<std::string> faults(const storage::StoreCheck& options = {}) { return findings(options).faults; }
};

TEST_F(StoreCheckTest, FindsNothingInAGoodDatabase) {
  const storage::StoreFindings found = findings({.run = {}, .integrity = true});
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_EQ(found.runs_verified, 2u);
  EXPECT_EQ(found.runs_incomplete, 0u);
  EXPECT_EQ(found.runs_without_digest, 0u);
  EXPECT_EQ(found.samples, 380u);
  EXPECT_EQ(findings({.run = 1, .integrity = false}).runs_verified, 1u);
}

TEST_F(StoreCheckTest, AChangedValueIsFoundInItsRunOnly) {
  damage("UPDATE sample SET duty = duty + 0.001 WHERE row = 57");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("run 1: its samples were changed")));
  EXPECT_THAT(faults({.run = 2, .integrity = false}), IsEmpty());
  EXPECT_THAT(faults({.run = 1, .integrity = false}), ElementsAre(HasSubstr("run 1: its samples were changed")));
}

TEST_F(StoreCheckTest, AValueThatBecameNullIsFound) {
  damage("UPDATE sample SET position_m = NULL WHERE row = 300");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("run 2: its samples were changed")));
}

TEST_F(StoreCheckTest, ARemovedRowIsFoundAndItsRunNamed) {
  damage("DELETE FROM sample WHERE row = 57");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("has 99 of its 100 rows"), HasSubstr("run 1: row 57")));
  EXPECT_THAT(faults({.run = 1, .integrity = false}), Contains(HasSubstr("run 1: the segment at sample 0")));
}

TEST_F(StoreCheckTest, SamplesThatChangedPlacesAreFound) {
  damage(
      "UPDATE sample SET row = -1 WHERE row = 20; UPDATE sample SET row = 20 WHERE row = 21;"
      "UPDATE sample SET row = 21 WHERE row = -1");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("run 1: its samples were changed")));
}

TEST_F(StoreCheckTest, AChangedModeClockOrFlagIsFound) {
  damage("UPDATE segment SET mode = 'auto' WHERE first_row = 1");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("run 1: its samples were changed")));
  damage("UPDATE segment SET mode = 'manual' WHERE first_row = 1");
  EXPECT_THAT(faults(), IsEmpty());
  damage("UPDATE segment SET utc_offset_us = utc_offset_us + 1 WHERE first_row = 1");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("run 1: its samples were changed")));
  damage("UPDATE segment SET utc_offset_us = utc_offset_us - 1, flags = 1 WHERE first_row = 1");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("run 1: samples_live is 180, the certificate says 280")));
}

TEST_F(StoreCheckTest, ALostSegmentIsMissedByTheDigest) {
  damage("DELETE FROM segment WHERE first_row = 101");
  EXPECT_THAT(faults(), Contains(HasSubstr("run 1: sample 100 of boot 18364758544493064720 is missing")));
}

TEST_F(StoreCheckTest, AGapThatBecameShorterOrHasAnotherCauseIsFound) {
  damage("UPDATE gap SET cause = 'ring_overrun'");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("run 1: the causes of its gaps")));
  damage("UPDATE gap SET last_seq = last_seq - 1");
  EXPECT_THAT(faults(), Contains(HasSubstr("run 1: sample 209 of boot")));
}

TEST_F(StoreCheckTest, OverlapsAreFound) {
  damage("UPDATE gap SET first_seq = first_seq - 3");
  EXPECT_THAT(faults(), Contains(HasSubstr("a gap of boot key 1 begins at sample 197")));
}

TEST_F(StoreCheckTest, ExtremesThatAreNotTheSamplesAreFoundWhenAllIsChecked) {
  damage(
      "UPDATE segment SET max_position_m = 7 WHERE first_row = 101; UPDATE segment SET min_duty = NULL"
      " WHERE first_row = 1");
  EXPECT_THAT(faults(), IsEmpty());
  EXPECT_THAT(faults({.run = {}, .integrity = true}), ElementsAre(HasSubstr("extremes of the segment at sample 0"),
                                                                  HasSubstr("extremes of the segment at sample 100")));
}

TEST_F(StoreCheckTest, SpansBeyondTheirBootAndHalfOpenRunsAreFound) {
  damage("UPDATE run_span SET last_seq = 500 WHERE run_id = 2");
  EXPECT_THAT(faults(), Contains(HasSubstr("run 2: span 0 ends at sample 500, but its boot made only 130")));
  damage("UPDATE run_span SET last_seq = NULL WHERE run_id = 2");
  EXPECT_THAT(faults(), Contains(HasSubstr("run 2: has ended, but its span 0 has not")));
  damage("UPDATE run_span SET last_seq = 129 WHERE run_id = 2; UPDATE run SET ended_at_us = NULL WHERE run_id = 2");
  EXPECT_THAT(faults(), Contains(HasSubstr("run 2: its state and its end contradict")));
}

TEST_F(StoreCheckTest, OrphansAndACounterThatFellBackAreFound) {
  damage("UPDATE meta SET value = 380 WHERE name = 'next_row'");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("next_row is 380, but sample has a row 380")));
  damage(
      "UPDATE meta SET value = 381 WHERE name = 'next_row';"
      "INSERT INTO marker (boot_key, seq, text, actor, made_at_us) VALUES (99, 0, '', '', 0)");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("a row of marker names a boot that is not there")));
  damage("DELETE FROM marker; UPDATE segment SET boot_key = 77 WHERE first_row = 1");
  EXPECT_THAT(faults(), Contains(HasSubstr("a segment belongs to boot key 77")));
}

TEST_F(StoreCheckTest, ARunWhoseSamplesAreOnTheirWayIsNoFault) {
  TestRobot robot;
  robot.boot_id = 5;
  start();
  connect(robot);
  const storage::RunId run = begin(robot);
  make(robot, 10);
  robot.next_seq += 5;
  make(robot, 10);
  ASSERT_TRUE(wait(runs_->end(run, "")).has_value());
  const storage::StoreFindings found = findings();  // beside the running station
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_EQ(found.runs_incomplete, 1u);
  EXPECT_EQ(found.runs_verified, 2u);
}

TEST_F(StoreCheckTest, SamplesThatWereReceivedBeforeAKillButNeverCameAreLostWithTheBoot) {
  TestRobot robot;
  robot.boot_id = 5;
  start();
  connect(robot);
  const storage::RunId run = begin(robot);
  make(robot, 10);
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE, 5000};
  foreign.exec("CREATE TRIGGER full BEFORE INSERT ON segment BEGIN SELECT RAISE(ABORT, 'the disk is full'); END");
  ASSERT_TRUE(wait(runs_->end(run, "")).has_value());
  kill();
  foreign.exec("DROP TRIGGER full");
  start();
  robot.boot_id = 6;
  connect(robot);
  flush();
  EXPECT_TRUE(wait(recording_->digester.find(run))->is_final);
  EXPECT_EQ(wait(runs_->find(run))->samples_lost, 10u);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(StoreCheckTest, AnUnknownRunIsDistinguished) {
  SQLite::Database database = storage::open_for_reading(path_);
  EXPECT_EQ(storage::check_store(database, {.run = 9, .integrity = false}).error().code, ErrorCode::not_found);
}

TEST_F(StoreCheckTest, FindsSamplesOutsideOfRunsThatAreInNothing) {
  damage(
      "DELETE FROM run_certificate; DELETE FROM in_force; DELETE FROM run_note; DELETE FROM run_span; DELETE FROM run");
  EXPECT_THAT(faults(), IsEmpty());
  damage(
      "DELETE FROM sample WHERE row BETWEEN (SELECT first_row FROM segment WHERE boot_key = 1 AND first_seq = 100)"
      " AND (SELECT last_row FROM segment WHERE boot_key = 1 AND first_seq = 100);"
      "DELETE FROM segment WHERE boot_key = 1 AND first_seq = 100");
  EXPECT_THAT(faults(), ElementsAre("samples 100 to 199 of boot key 1 are neither stored nor in a gap"));
  damage("DELETE FROM gap");
  EXPECT_THAT(faults(), ElementsAre("samples 100 to 209 of boot key 1 are neither stored nor in a gap"));
}

}  // namespace
}  // namespace server
