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

  void say(const std::string& kind, const std::string& content, std::uint64_t first_seq, bool is_change = false) {
    recorder_->on_in_force(RobotState{}, {.boot_id = robot_.boot_id,
                                          .kind = kind,
                                          .is_change = is_change,
                                          .first_seq = first_seq,
                                          .content = content,
                                          .noticed_at_us = clock_.utc_us()});
  }
  std::vector<std::string> in_force() {
    wait(recorder_->flush_records());
    return rows(
        "SELECT kind, first_seq, content FROM in_force JOIN document USING (document_key, kind)"
        " ORDER BY kind, first_seq");
  }

  TestRobot robot_;
};

TEST_F(InForceStoreTest, ATextIsStoredOnceAndWhatIsToldAgainAddsNothing) {
  say("controller", "{\"kp\":1}", 0);
  say("parameters", "{\"kp\":1}", 0);    // another kind with the same text
  say("controller", "{\"kp\":1}", 500);  // after a reconnection
  say("controller", "{\"kp\":2}", 700);
  say("controller", "{\"kp\":1}", 900);  // and back
  const std::vector<std::string> expected{"controller|0|{\"kp\":1}", "controller|700|{\"kp\":2}",
                                          "controller|900|{\"kp\":1}", "parameters|0|{\"kp\":1}"};
  EXPECT_EQ(in_force(), expected);
  EXPECT_EQ(number("SELECT count(*) FROM document"), 3);
}

TEST_F(InForceStoreTest, WhatABootSaysFirstHoldsFromItsBeginning) {
  say("controller", "{\"kp\":1}", 200);  // it had made 200 samples when it connected
  say("controller", "{\"kp\":2}", 300, true);
  say("parameters", "{}", 400, true);  // what was before has not been recorded
  const std::vector<std::string> expected{"controller|0|{\"kp\":1}", "controller|300|{\"kp\":2}", "parameters|400|{}"};
  EXPECT_EQ(in_force(), expected);
}

TEST_F(InForceStoreTest, ANumberThatCannotBeIsNotStored) {
  say("controller", "{}", kMaxRobotNumber + 1, true);
  EXPECT_TRUE(in_force().empty());
}

TEST_F(InForceStoreTest, OfABootThatIsNotRecordedNothingIsStored) {
  robot_.boot_id = 12345;
  say("controller", "{}", 0);
  EXPECT_TRUE(in_force().empty());
}

TEST_F(InForceStoreTest, ClockEstimatesAreStoredWithTheirBoot) {
  recorder_->on_clock(RobotState{}, {.boot_id = robot_.boot_id,
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
  say("controller", "before", 0);
  say("controller", "at its begin", 40);
  make(robot_, 100);
  const Run run = *wait(runs_->create("nemo", named("a run"), {"test", "", 0}));
  say("controller", "in it", 150);
  make(robot_, 100);
  flush();
  wait(runs_->end(run.id, ""));
  say("controller", "after", 250);
  wait(recorder_->flush_records());
  const std::vector<std::string> expected{"controller|100|at its begin", "controller|150|in it"};
  EXPECT_EQ(rows("SELECT kind, first_seq, content FROM run_in_force ORDER BY first_seq"), expected);
}

}  // namespace
}  // namespace server
