// A database of an older schema is brought up to date when it is opened, and reads the same before and after.
#include <fstream>
#include <sstream>

#include "server/runtime/sha256.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/upkeep/audit_check.hpp"
#include "server/storage/upkeep/store_check.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class MigrationTest : public RecordingTest {
 protected:
  static constexpr station::BootId kFirstBoot = 18364758544493064720U;  // of tests/data/recording/version_1.sql
  static constexpr station::BootId kSecondBoot = 4711;

  void make_version(int version) {
    std::ifstream in{std::filesystem::path{TEST_DATA_DIR} / fmt::format("recording/version_{}.sql", version)};
    std::ostringstream sql;
    sql << in.rdbuf();
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
    database.exec(sql.str());
  }
  void make_version_1() {
    make_version(1);
    ASSERT_EQ(number("SELECT count(*) FROM run_sample"), 250);
  }

  // Everything that version 1 said of its runs.
  std::vector<std::string> runs_as_read() {
    std::vector<std::string> all;
    for (const char* query :
         {"SELECT run_id, span, boot_id, seq, robot_time_us, utc_us, clock_uncertainty_us, received_at_us, position_m,"
          " velocity_m_s, acceleration_m_s2, duty, impedance_mv, reference_m, mode, sub_state, setpoint_m,"
          " disturbance_m, position_sd_m, controller_id, emergency_id, emergency_cause, flags FROM run_sample",
          "SELECT * FROM run_gap", "SELECT * FROM robot_gap",
          "SELECT robot_id, boot_id, boot_key, reset_cause, firmware_version, sample_period_us, first_seen_at_us"
          " FROM robot_boot",
          "SELECT event_row, robot_id, boot_id, event_seq, robot_time_us, sample_seq, kind, cause, mode, sub_state,"
          " position_m, value, emergency_id, command_id, received_at_us FROM robot_event",
          "SELECT run_id, robot_id, name, fluid, pump_profile, mean_flow_m_s, tube, operator_name, notes, verdict,"
          " firmware_version, controller_id, controller_checksum, parameters_checksum, started_at_us, ended_at_us"
          " FROM run"}) {
      const std::vector<std::string> found = rows(query);
      all.insert(all.end(), found.begin(), found.end());
    }
    return all;
  }

  std::vector<std::string> plan(const std::string& query) {
    std::vector<std::string> steps;
    for (const std::string& row : rows("EXPLAIN QUERY PLAN " + query)) {
      steps.push_back(row.substr(row.rfind('|') + 1));
    }
    return steps;
  }
};

TEST(Migrations, AreFilesThatAreNumberedFromOne) {
  std::size_t number = 0;
  for (const base::EmbeddedFile& file : storage::migration_files())
    EXPECT_EQ(file.name, std::to_string(++number) + ".sql");
  EXPECT_EQ(number, storage::migrations().size());
  EXPECT_GE(number, 7U);
}

// A file that a station wrote has run the scripts of its version: what comes after is a script of its own. A new one is
// added to the list, by sha256sum.
TEST(Migrations, StayAsTheyWere) {
  std::ifstream list{std::filesystem::path{TEST_DATA_DIR} / "recording/migrations.sha256"};
  for (const base::EmbeddedFile& script : storage::migration_files()) {
    std::string sha256;
    std::string name;
    list >> sha256 >> name;
    EXPECT_EQ(name, script.name);
    EXPECT_EQ(script.digest, sha256.substr(0, script.digest.size()))
        << script.name << " differs from what was released: add a file";
  }
  std::string more;
  EXPECT_FALSE(list >> more) << more;
}

TEST_F(MigrationTest, EveryRunOfVersion1ReadsTheSame) {
  make_version_1();
  const std::vector<std::string> before = runs_as_read();
  {
    const storage::Database database{path_};
    EXPECT_EQ(database.store_id(), kFirstBoot);  // the file's id is the same number
  }
  EXPECT_EQ(number("PRAGMA user_version"), static_cast<std::int64_t>(storage::migrations().size()));
  EXPECT_EQ(runs_as_read(), before);
  EXPECT_EQ(number("SELECT count(*) FROM run_sample WHERE first_received_at_us <> received_at_us"), 0);
  EXPECT_EQ(number("SELECT count(*) FROM run_sample WHERE backfilled"), 50);
  EXPECT_EQ(rows("SELECT run_id, state, made_afterwards, made_by, profile FROM run ORDER BY run_id"),
            (std::vector<std::string>{"1|ended|0||", "2|open|0||"}));
  EXPECT_EQ(rows("PRAGMA foreign_key_check"), std::vector<std::string>{});
  EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
}

TEST_F(MigrationTest, AMigratedFileHasTheSchemaOfANewOne) {
  constexpr const char* kSchema =
      "SELECT type, name, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite%' ORDER BY 1, 2";
  make_version_1();
  {
    const storage::Database database{path_};
  }
  const std::vector<std::string> migrated = rows(kSchema);
  std::filesystem::remove(path_);
  {
    const storage::Database database{path_};
  }
  EXPECT_EQ(rows(kSchema), migrated);
}

TEST_F(MigrationTest, AStationGoesOnWhereVersion1Stopped) {
  make_version_1();
  start();
  TestRobot robot;
  robot.boot_id = kSecondBoot;
  robot.late_us = 100'000;
  robot.next_seq = 90;
  connect(robot);
  make(robot, 10);
  flush();
  EXPECT_EQ(durable_next_seq_, 100u);
  EXPECT_EQ(rows("SELECT first_row, last_row FROM segment ORDER BY first_row DESC LIMIT 1"),
            std::vector<std::string>{"301|310"});
  const storage::SamplePage page = wait(history_->samples(2, std::nullopt, 1000)).value();
  EXPECT_EQ(page.samples.size(), 60u);  // interrupted by the stop of version 1
  EXPECT_EQ(page.samples.back().seq, 89u);
  EXPECT_EQ(wait(runs_->find(2))->state, storage::RunState::interrupted);
  const Run first = wait(runs_->find(1)).value();
  EXPECT_EQ(first.state, storage::RunState::ended);
  EXPECT_EQ(first.samples_stored, 190u);
  EXPECT_EQ(first.samples_lost, 10u);
}

// What was commanded before there was an audit has no entry; what has none and came later is a fault.
TEST_F(MigrationTest, CommandsOfBeforeTheAuditAreCounted) {
  make_version_1();
  const auto faults = [this] {
    SQLite::Database database = storage::open_for_reading(path_);
    return storage::check_audit(database, {}).faults;
  };
  const auto add = [this](std::int64_t id, const char* state) {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE, 5000};
    database.exec(
        "INSERT INTO command (command_id, robot_id, boot_id, kind, arguments, actor, state, reason,"
        " submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us, emergency_id) VALUES (" +
        std::to_string(id) + ", 'nemo', 1, 'ping', '{}', 'token:local', '" + state + "', '', 1, 0, 0, 0, 0)");
  };
  const std::int64_t before = number("SELECT count(*) FROM command");
  add(5, "acknowledged");
  add(6, "sent");  // nobody follows it any more: its end is in the audit
  start();
  EXPECT_EQ(number("SELECT value FROM meta WHERE name = 'commands_before_audit'"), before + 1);
  EXPECT_EQ(rows("SELECT command.state, audit.action FROM command JOIN audit ON audit_entry = entry"),
            std::vector<std::string>{"unknown|command.unknown"});
  stop();
  EXPECT_EQ(faults(), std::vector<std::string>{});
  add(7, "acknowledged");
  EXPECT_EQ(faults().size(), 1u);
}

// Of every version that has a file here, brought up to date and then run by a station.
TEST_F(MigrationTest, EveryOldSchemaVerifiesAfterItsUpdate) {
  for (const int version : {1, 6, 11}) {
    std::filesystem::remove(path_);
    make_version(version);
    const auto faults = [this] {
      SQLite::Database database = storage::open_for_reading(path_);
      std::vector<std::string> found = storage::check_store(database, {.run = {}, .integrity = true})->faults;
      for (std::string& fault : storage::check_audit(database, {}).faults) found.push_back(std::move(fault));
      return found;
    };
    {
      const storage::Database database{path_};
    }
    EXPECT_EQ(faults(), std::vector<std::string>{}) << "version " << version << ", updated";
    start();
    clock_.run_for(2s);
    stop();
    EXPECT_EQ(faults(), std::vector<std::string>{}) << "version " << version << ", after a station";
  }
}

// Of experiments that are still kept; one whose run was never made has none.
TEST_F(MigrationTest, RunsOfExperimentsGetTheirOrigin) {
  make_version(11);
  {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
    database.exec(
        "INSERT INTO experiment (experiment_id, robot_id, name, profile, notes, priority, unattended, state, owner,"
        " acts_for, place, runs_planned, duration_s, created_at_us) VALUES (7, 'nemo', 'rest', 'the profile', '', 0, 0,"
        " 'done', 'token:local', 'token:local', 1, 2, 5, 1)");
    database.exec(
        "INSERT INTO experiment_run (experiment_id, number, state, run_id, variant, steps, started_at_us) VALUES"
        " (7, 1, 'done', 2, '{}', '[]', 1), (7, 2, 'aborted', NULL, '{}', '[]', 2)");
  }
  start();
  EXPECT_EQ(rows("SELECT run_id, experiment_id, number, variant, profile_sha256, profile FROM run_origin"),
            (std::vector<std::string>{"2|7|1|{}||the profile"}));
  const auto run = wait(runs_->find(2));
  ASSERT_TRUE(run && run->origin);
  EXPECT_EQ(run->origin->experiment, 7);
  EXPECT_EQ(run->origin->profile_sha256, runtime::sha256_of("the profile"));
}

TEST_F(MigrationTest, ToolsReadVersion1WithoutChangingIt) {
  make_version_1();
  const auto samples = storage::read_run(path_, 1, 1000);
  ASSERT_TRUE(samples.has_value()) << samples.error().detail;
  ASSERT_EQ(samples->size(), 190u);
  const storage::StoredSample& sample = samples->at(50);  // seq 100 of the first boot
  EXPECT_EQ(sample.boot_id, kFirstBoot);
  EXPECT_EQ(sample.first_received_at_us, 1'700'000'002'000'000);
  EXPECT_EQ(sample.received_at_us, 1'700'000'002'000'000);
  EXPECT_EQ(sample.emergency_id, kFirstBoot);
  EXPECT_EQ(sample.emergency_cause, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  EXPECT_EQ(sample.controller_id, 7u);
  EXPECT_EQ(sample.flags, 1u);
  EXPECT_EQ(sample.clock_uncertainty_us, 300);
  EXPECT_EQ(number("PRAGMA user_version"), 1);
}

TEST_F(MigrationTest, WhatIsAskedOftenIsAnsweredByIndex) {
  {
    const storage::Database database{path_};
  }
  EXPECT_EQ(plan("SELECT robot_time_us, iif(kind = 'emergency', emergency_id, 0) FROM event WHERE boot_key = 1"
                 " AND event_seq IS NOT NULL AND kind IN ('emergency', 'emergency_cleared')"
                 " ORDER BY event_seq DESC LIMIT 1"),
            (std::vector<std::string>{"SEARCH event USING INDEX event_of_latch (boot_key=? AND event_seq>?)"}));
  EXPECT_EQ(plan("SELECT * FROM run_marker WHERE run_id = 1"),
            (std::vector<std::string>{"SEARCH run_span USING PRIMARY KEY (run_id=?)",
                                      "SEARCH boot USING INTEGER PRIMARY KEY (rowid=?)",
                                      "SEARCH marker USING INDEX marker_by_seq (boot_key=? AND seq>? AND seq<?)"}));
  EXPECT_EQ(plan("SELECT 1 FROM run WHERE robot_id = 'nemo' AND state <> 'discarded' AND started_at_us <= 5"
                 " AND coalesce(ended_at_us, 9) >= 5"),
            std::vector<std::string>{"SEARCH run USING INDEX run_by_robot (robot_id=? AND started_at_us<?)"});
  EXPECT_EQ(plan("SELECT effect_at_robot_us, command.emergency_id FROM boot JOIN command USING (robot_id, boot_id)"
                 " WHERE boot_key = 1 AND kind = 'emergency_stop' AND effect_at_robot_us > 0"
                 " ORDER BY effect_at_robot_us DESC LIMIT 1"),
            (std::vector<std::string>{"SEARCH boot USING INTEGER PRIMARY KEY (rowid=?)",
                                      "SEARCH command USING INDEX command_stop (boot_id=? AND effect_at_robot_us>?)"}));
}

// What was in force at a span's first sample counts, and what came into force within it; nothing before or after.
TEST_F(MigrationTest, RunInForceShowsWhatASpanWasMadeWith) {
  make_version_1();
  storage::Database database{path_};
  database.handle().exec(
      "INSERT INTO document VALUES (1, 'controller', x'01', '{\"id\":1}'), (2, 'controller', x'02', '{\"id\":2}'),"
      " (3, 'controller', x'0a', '{\"id\":3}'), (4, 'parameters', x'04', '{}');"
      "INSERT INTO in_force VALUES (1, 'controller', 0, 1, 0), (1, 'controller', 40, 2, 0),"
      " (1, 'controller', 200, 3, 0), (1, 'controller', 230, 1, 0), (1, 'parameters', 50, 4, 0);");
  EXPECT_EQ(rows("SELECT span, kind, first_seq, content, sha256 FROM run_in_force WHERE run_id = 1 ORDER BY 1, 2, 3"),
            (std::vector<std::string>{"0|controller|50|{\"id\":2}|02", "0|controller|200|{\"id\":3}|0a",
                                      "0|parameters|50|{}|04"}));
}

}  // namespace
}  // namespace server
