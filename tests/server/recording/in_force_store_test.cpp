// What a robot says is in force, and how its clock was found to run, in the database.
#include "server/station/state/checked.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class InForceStoreTest : public RecordingTest {
 protected:
  InForceStoreTest() {
    start();
    admit(robot_);
    connect(robot_);
  }

  void report(station::InForceContent content, std::uint64_t first_seq, bool is_change = false) {
    recorder_->on_in_force(station::RobotState{}, {.boot_id = robot_.boot_id,
                                                   .is_change = is_change,
                                                   .first_seq = first_seq,
                                                   .content = std::move(content),
                                                   .noticed_at_us = clock_.utc_us()});
  }
  static protocol::Controller controller(float kp) {
    protocol::Controller controller = rheonaut_Controller_init_zero;
    controller.kp = kp;
    return controller;
  }
  // The kind, the first sample, and the part in which the documents of these tests differ.
  std::vector<std::string> in_force() {
    wait(recorder_->flush_records());
    return rows(
        "SELECT kind, first_seq, coalesce(json_extract(content, '$.kp'), content)"
        " FROM in_force JOIN document USING (document_key, kind) ORDER BY kind, first_seq");
  }

  TestRobot robot_;
};

TEST_F(InForceStoreTest, ATextIsStoredOnceAndWhatIsReportedAgainAddsNothing) {
  report(controller(1), 0);
  report(station::ReportedParameters{}, 0);  // another kind
  report(controller(1), 500);                // after a reconnection
  report(controller(2), 700);
  report(controller(1), 900);  // and back
  const std::vector<std::string> expected{"controller|0|1.0", "controller|700|2.0", "controller|900|1.0",
                                          "parameters|0|{}"};
  EXPECT_EQ(in_force(), expected);
  EXPECT_EQ(number("SELECT count(*) FROM document"), 3);
}

TEST_F(InForceStoreTest, WhatABootSaysFirstHoldsFromItsBeginning) {
  report(controller(1), 200);  // it had made 200 samples when it connected
  report(controller(2), 300, true);
  report(station::ReportedParameters{}, 400, true);  // what was before has not been recorded
  const std::vector<std::string> expected{"controller|0|1.0", "controller|300|2.0", "parameters|400|{}"};
  EXPECT_EQ(in_force(), expected);
}

TEST_F(InForceStoreTest, ANumberThatCannotBeIsNotStored) {
  report(controller(1), station::kMaxRobotNumber + 1, true);
  EXPECT_TRUE(in_force().empty());
}

TEST_F(InForceStoreTest, OfABootThatIsNotRecordedNothingIsStored) {
  robot_.boot_id = 12345;
  report(controller(1), 0);
  EXPECT_TRUE(in_force().empty());
}

TEST_F(InForceStoreTest, ClockEstimatesAreStoredWithTheirBoot) {
  recorder_->on_clock(station::RobotState{}, {.boot_id = robot_.boot_id,
                                              .robot_time_us = 61'000'000,
                                              .utc_offset_us = 1'750'000'000'000'000,
                                              .uncertainty_us = 420,
                                              .drift_ppm = -12.5,
                                              .round_trip_us = 800,
                                              .station_step_us = 3'600'000'000});
  wait(recorder_->flush_records());
  const std::vector<std::string> expected{"nemo|61000000|1750000061000000|420|-12.5|800|3600000000"};
  EXPECT_EQ(rows("SELECT robot_id, robot_time_us, utc_us, uncertainty_us, drift_ppm, round_trip_us, station_step_us"
                 " FROM boot_clock"),
            expected);
}

TEST_F(InForceStoreTest, ARunShowsWhatWasInForceInIt) {
  report(controller(1), 0);   // before it
  report(controller(2), 40);  // at its begin
  make(robot_, 100);
  const Run run = *wait(runs_->create("nemo", named("a run"), {"test", "", 0}));
  report(controller(3), 150);  // in it
  make(robot_, 100);
  flush();
  wait(runs_->end(run.id, ""));
  report(controller(4), 250);  // after it
  wait(recorder_->flush_records());
  const std::vector<std::string> expected{"controller|100|2.0", "controller|150|3.0"};
  EXPECT_EQ(rows("SELECT kind, first_seq, json_extract(content, '$.kp') FROM run_in_force ORDER BY first_seq"),
            expected);
}

}  // namespace
}  // namespace server
