// A robot that does not come back: what is missing of its runs is given up, and stays so when it comes back all the
// same.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "tests/server/recording/recorder_fixture.hpp"
#include "tests/server/recording/stored_runs.hpp"

namespace server {
namespace {

using nlohmann::json;

class GivenUpTest : public RecorderFixture {
 protected:
  static constexpr std::uint64_t kMissing = 20;  // 20..39 of every run that is begun here

  void begin(const config::RecordingConfig& config = {}) {
    start({}, config);
    recorder_->set_on_returned([this](const storage::ReturnedSamples& returned) {
      returned_.push_back(
          fmt::format("{} of {} to {}", returned.samples, returned.range.first, returned.range.next - 1));
    });
  }
  // Run 1 has samples 0 to 49; 20 to 39 were made, and their robot is away.
  storage::RunId record_and_lose_robot() {
    connect(robot_);
    const storage::RunId id = wait(runs_->create(robot_.id, named("lost")))->id;
    make(robot_, 20);
    robot_.next_seq = 40;
    make(robot_, 10);
    disconnect(robot_);
    EXPECT_TRUE(wait(runs_->end(id, "")).has_value());
    return id;
  }
  Result<std::uint64_t> finalize(storage::RunId id, std::uint64_t samples = kMissing) {
    const station::Author anna{"user:anna", "10.0.0.7", 0};
    return wait(recording_->finalizer.finalize(id, samples, anna));
  }
  std::optional<storage::RunDigest> digest(storage::RunId id) {
    const Result<storage::CurrentDigest> found = wait(recording_->digester.find(id));
    return found && found->is_final ? std::optional{found->digest} : std::nullopt;
  }
  // It goes on with its boot, and still holds the samples from this one on.
  void return_with(std::uint64_t oldest_seq) {
    robot_.oldest_seq = oldest_seq;
    connect(robot_);
  }
  void restart() {
    stop();
    begin();
  }
  // The station looks every few minutes.
  void be_there(microseconds for_us) {
    for (microseconds left = for_us; left > 0us; left -= 4min) {
      clock_.skip(std::min<microseconds>(left, 4min));
      clock_.run_for(1s);
    }
  }
  // At the end of it the station was there for more than an hour.
  void pass_time(microseconds by) {
    clock_.skip(by - 61min);
    clock_.run_for(1s);
    be_there(61min);
  }
  json audit(const std::string& action) {
    json entries = json::array();
    for (const std::string& row : rows("SELECT actor || ' ' || subject || ' ' || detail FROM audit WHERE action = '" +
                                       action + "' ORDER BY entry")) {
      const std::size_t detail = row.find('{');
      entries.push_back({{"of", row.substr(0, detail - 1)}, {"detail", json::parse(row.substr(detail))}});
    }
    return entries;
  }
  void revoke() {
    recorder_->set_revoked(robot_.id, true);
    auto job = [](storage::Database& database) {
      database.handle().exec("UPDATE robot SET revoked_at_us = 1, revoked_by = 'user:anna'");
    };
    wait(recorder_->on_disk(std::move(job)));
  }
  // Nothing is stored twice, or both stored and lost.
  std::vector<std::string> faults() {
    SQLite::Database database{path_.string()};
    return coverage_faults(database);
  }

  std::vector<std::string> returned_;  // as it was reported
};

TEST_F(GivenUpTest, AWordMakesARunFinalAndIsInTheAudit) {
  begin();
  const storage::RunId id = record_and_lose_robot();
  EXPECT_FALSE(digest(id));
  EXPECT_EQ(finalize(id).value_or(0), kMissing);
  EXPECT_EQ(gaps(), Rows{"20|39|given_up"});
  const auto made = digest(id);
  ASSERT_TRUE(made);
  EXPECT_EQ(made->samples_live, 30U);
  EXPECT_EQ(made->lost_by_cause, (std::map<std::string, std::uint64_t>{{"given_up", 20}}));
  const json boot{{"boot_id", std::to_string(robot_.boot_id)}, {"first_seq", 20}, {"last_seq", 39}, {"samples", 20}};
  EXPECT_EQ(audit("run.finalized"),
            json::array({{{"of", "user:anna 1"},
                          {"detail", {{"reason", "asked"}, {"samples", 20}, {"boots", json::array({boot})}}}}}));
  EXPECT_EQ(recorder_->counters().samples_given_up, 20U);
  EXPECT_EQ(finalize(id, 0).value_or(99), 0U) << "a run that is final";
  EXPECT_EQ(audit("run.finalized").size(), 1U) << "nothing was given up";
}

TEST_F(GivenUpTest, ABootThatReturnsIsToldAndCountedAndChangesNothing) {
  begin();
  const storage::RunId id = record_and_lose_robot();
  ASSERT_TRUE(finalize(id));
  const std::string sha256 = digest(id)->sha256;
  const Rows stored = segments();
  robot_.next_seq = 60;
  robot_.oldest_seq = 10;
  EXPECT_EQ(admit(robot_).durable_next_seq, 50U) << "the robot may discard what lies below";
  return_with(10);
  clock_.run_for(2s);
  EXPECT_EQ(returned_, Rows{"20 of 20 to 39"});
  EXPECT_EQ(recorder_->counters().samples_returned, 20U);
  EXPECT_EQ(missing_.back(), (Missing{50, 60})) << "what was given up is not asked for";
  send(robot_, 10, 40);  // all the same
  flush();
  EXPECT_EQ(segments(), stored);
  EXPECT_EQ(gaps(), Rows{"20|39|given_up"});
  EXPECT_EQ(recorder_->counters().samples_duplicate, 20U) << "10 to 19 and 40 to 49 were stored";
  send(robot_, 50, 10);
  flush();
  EXPECT_EQ(durable_next_seq_, 60U);
  EXPECT_EQ(digest(id)->sha256, sha256);
  EXPECT_EQ(faults(), Rows{});
  disconnect(robot_);
  connect(robot_);
  clock_.run_for(1s);
  EXPECT_EQ(returned_.size(), 1U) << "they are counted once";
}

TEST_F(GivenUpTest, AStationThatWasStoppedBetweenKnowsThemStill) {
  begin();
  const storage::RunId id = record_and_lose_robot();
  restart();  // the boot is in no memory
  ASSERT_TRUE(finalize(id)) << "of a boot that is only on disk";
  const std::string sha256 = digest(id)->sha256;
  restart();
  EXPECT_EQ(admit(robot_).durable_next_seq, 50U);
  return_with(30);
  send(robot_, 20, 20);
  flush();
  EXPECT_EQ(returned_, Rows{"10 of 30 to 39"});
  EXPECT_EQ(gaps(), Rows{"20|39|given_up"});
  EXPECT_EQ(digest(id)->sha256, sha256);
  EXPECT_EQ(faults(), Rows{});
}

TEST_F(GivenUpTest, WhatBelongsToNoSuchRunIsStillExpected) {
  begin();
  connect(robot_);
  robot_.next_seq = 10;  // 0 to 9 are missing, before the run
  make(robot_, 5);
  disconnect(robot_);
  connect(robot_);
  const storage::RunId id = wait(runs_->create(robot_.id, named("later")))->id;
  robot_.next_seq = 25;  // 15 to 24 are missing in it
  make(robot_, 5);
  disconnect(robot_);
  ASSERT_TRUE(wait(runs_->end(id, "")));
  ASSERT_EQ(finalize(id, 10).value_or(0), 10U);
  EXPECT_EQ(gaps(), Rows{"15|24|given_up"});
  return_with(0);
  clock_.run_for(1s);
  EXPECT_EQ(missing_.back(), (Missing{0, 10}));
  send(robot_, 0, 30);
  flush();
  EXPECT_EQ(gaps(), Rows{"15|24|given_up"});
  EXPECT_EQ(samples(), 20);
  EXPECT_EQ(durable_next_seq_, 30U);
}

TEST_F(GivenUpTest, NothingIsGivenUpThatTheCallerDidNotSee) {
  begin();
  connect(robot_);
  const storage::RunId open = wait(runs_->create(robot_.id, named("open")))->id;
  EXPECT_EQ(finalize(open, 0).error().code, ErrorCode::conflict);
  EXPECT_EQ(finalize(99, 0).error().code, ErrorCode::not_found);
  make(robot_, 10);
  robot_.next_seq = 20;
  make(robot_, 10);
  ASSERT_TRUE(wait(runs_->end(open, "")));
  EXPECT_EQ(finalize(open, 10).error().reason, "robot_connected");
  disconnect(robot_);
  EXPECT_EQ(finalize(open, 9).error().reason, "missing_changed");
  EXPECT_EQ(gaps(), Rows{});
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE action = 'run.finalized'"), 0);
  const station::Author anna{"user:anna", "", 0};
  ASSERT_TRUE(wait(runs_->discard(open, "", anna)));
  EXPECT_EQ(finalize(open, 10).error().code, ErrorCode::conflict);
}

// Neither gaps without their entry nor an entry without its gaps.
TEST_F(GivenUpTest, AKillLeavesTheOldStateOrTheNewOne) {
  begin();
  const storage::RunId id = record_and_lose_robot();
  {
    SQLite::Database other{path_.string(), SQLite::OPEN_READWRITE};
    SQLite::Transaction lock{other, SQLite::TransactionBehavior::IMMEDIATE};
    EXPECT_EQ(finalize(id).error().code, ErrorCode::unavailable);
    kill();
  }
  begin();
  EXPECT_EQ(gaps(), Rows{});
  EXPECT_EQ(audit("run.finalized").size(), 0U);
  EXPECT_FALSE(digest(id));
  ASSERT_TRUE(finalize(id));
  kill();  // before the digest is looked at
  begin();
  EXPECT_EQ(audit("run.finalized").size(), 1U);
  EXPECT_TRUE(digest(id));
}

TEST_F(GivenUpTest, ARevokedRobotLosesAllThatIsMissingOfIt) {
  begin();
  connect(robot_);
  robot_.next_seq = 10;  // before any run
  make(robot_, 5);
  disconnect(robot_);
  revoke();
  const station::Author anna{"user:anna", "", 0};
  EXPECT_EQ(wait(recording_->finalizer.give_up_revoked(robot_.id, anna)).value_or(0), 10U);
  EXPECT_EQ(gaps(), Rows{"0|9|given_up"});
  EXPECT_EQ(audit("robot.samples_given_up").at(0).at("of"), "user:anna nemo");
}

TEST_F(GivenUpTest, ARobotThatWasRevokedBeforeAKillIsLookedForAgain) {
  begin();
  const storage::RunId id = record_and_lose_robot();
  revoke();
  kill();
  begin();
  EXPECT_FALSE(digest(id));
  clock_.run_for(31s);
  EXPECT_EQ(gaps(), Rows{"20|39|given_up"});
  EXPECT_TRUE(digest(id));
  EXPECT_EQ(audit("robot.samples_given_up").at(0).at("of"), "station nemo");
}

TEST_F(GivenUpTest, AfterTheConfiguredTimeARunIsFinalUnlessItsRobotWasThere) {
  config::RecordingConfig config;
  config.give_up_after_days = 2;
  begin(config);
  const storage::RunId id = record_and_lose_robot();
  pass_time(24h);
  connect(robot_);  // for a moment
  disconnect(robot_);
  pass_time(47h);
  EXPECT_EQ(gaps(), Rows{});
  pass_time(2h);
  EXPECT_EQ(gaps(), Rows{"20|39|given_up"});
  EXPECT_TRUE(digest(id));
  const json entry = audit("run.finalized").at(0);
  EXPECT_EQ(entry["of"], "station 1");
  EXPECT_EQ(entry["detail"]["reason"], "time");
  EXPECT_EQ(entry["detail"]["after_days"], 2);
}

TEST_F(GivenUpTest, ByItselfNothingIsEverGivenUp) {
  begin();
  record_and_lose_robot();
  pass_time(240h);
  EXPECT_EQ(gaps(), Rows{});
}

TEST_F(GivenUpTest, AfterTheMachineWasSuspendedRobotsHaveTimeToComeBack) {
  config::RecordingConfig config;
  config.give_up_after_days = 1;
  begin(config);
  record_and_lose_robot();
  clock_.skip(100h);
  clock_.run_for(1s);
  be_there(58min);
  EXPECT_EQ(gaps(), Rows{});
  be_there(3min);
  EXPECT_EQ(gaps(), Rows{"20|39|given_up"});
}

TEST_F(GivenUpTest, ASetClockMakesNoRunOlder) {
  config::RecordingConfig config;
  config.give_up_after_days = 1;
  begin(config);
  record_and_lose_robot();
  clock_.step_utc(100h);
  be_there(61min);
  EXPECT_EQ(gaps(), Rows{});
}

// The station was off for longer than the time: robots have an hour to come back first.
TEST_F(GivenUpTest, AfterAStartRobotsHaveTimeToComeBack) {
  begin();
  const storage::RunId id = record_and_lose_robot();
  stop();
  clock_.skip(100h);
  config::RecordingConfig config;
  config.give_up_after_days = 1;
  begin(config);
  be_there(58min);
  EXPECT_EQ(gaps(), Rows{});
  return_with(0);
  send(robot_, 20, 20);
  flush();
  pass_time(30h);
  EXPECT_EQ(gaps(), Rows{});
  EXPECT_EQ(digest(id)->samples_lost, 0U);
}

}  // namespace
}  // namespace server
