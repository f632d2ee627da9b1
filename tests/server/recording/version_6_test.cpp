// What stations of schema versions 6 and 11 (0.9.0) recorded, digested, exported and audited stays as it was under the
// present schema.
#include <fmt/ranges.h>
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "server/cli/data/export.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/upkeep/audit_check.hpp"
#include "server/storage/upkeep/store_check.hpp"
#include "tests/server/recording/recording_test.hpp"
#include "tests/server/recording/schema_dump.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;
using ::testing::StartsWith;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in{text};
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// A line of CSV without `t_s`, the fifth field, which exports have had since.
std::string without_t_s(const std::string& line) {
  std::size_t from = 0;
  for (int field = 0; field < 4; ++field) from = line.find(',', from) + 1;
  return line.substr(0, from) + line.substr(line.find(',', from) + 1);
}

class Version6Test : public RecordingTest {
 protected:
  void SetUp() override { make_database(path_, "version_6.sql"); }

  void migrate() {
    {
      const storage::Database database{path_};
    }
    ASSERT_EQ(number("PRAGMA user_version"), static_cast<std::int64_t>(storage::migrations().size()));
  }

  // As `rheonaut verify --json` says it.
  nlohmann::json verified() {
    SQLite::Database database = storage::open_for_reading(path_);
    const storage::StoreFindings store = storage::check_store(database, {.run = {}, .integrity = true}).value();
    const storage::AuditFindings audit = storage::check_audit(database, {});
    std::vector<std::string> faults = store.faults;
    faults.insert(faults.end(), audit.faults.begin(), audit.faults.end());
    return {{"faults", faults},
            {"segments", store.segments},
            {"samples", store.samples},
            {"runs_verified", store.runs_verified},
            {"runs_incomplete", store.runs_incomplete},
            {"runs_uncertified", store.runs_without_digest},
            {"integrity_checked", true},
            {"audit_entries", audit.entries},
            {"audit_hidden", audit.hidden},
            {"audit_commands", audit.commands},
            {"audit_head", text(audit.head)}};
  }

  fs::path exported(cli::ExportFormat format, storage::RunId run = 1) {
    cli::Export options;
    options.run = run;
    options.format = format;
    options.to = folder_ / fmt::format("run_{}.{}", run, storage::text(format));
    options.data_dir = folder_;
    std::ostringstream out;
    EXPECT_EQ(cli::run(options, out), 0);
    return options.to;
  }
};

std::vector<std::string> column(SQLite::Database& database, const std::string& sql) {
  std::vector<std::string> found;
  SQLite::Statement query{database, sql};
  while (query.executeStep()) found.push_back(query.getColumn(0).getString());
  return found;
}

// What the columns `names` of a table hold, a line per row.
std::vector<std::string> rows_of(SQLite::Database& database, const std::string& table,
                                 const std::vector<std::string>& names) {
  std::vector<std::string> quoted;
  for (const std::string& name : names) quoted.push_back("quote(" + name + ")");
  std::vector<std::string> rows =
      column(database, fmt::format("SELECT {} FROM {}", fmt::join(quoted, " || '|' || "), table));
  std::ranges::sort(rows);
  return rows;
}

TEST_F(Version6Test, VerifyFindsWhatItFoundBefore) {
  migrate();
  EXPECT_EQ(verified(), nlohmann::json::parse(test_data("version_6_verify.json")));
  EXPECT_EQ(rows("SELECT run_id, format, sha256 FROM run_certificate"),
            std::vector<std::string>{"1|1|8a1128e51bce44795f52ea219c6bebc8fe9dc1252297d3cc2954b7a3bd69e154"});
}

TEST_F(Version6Test, TheExportsOfARunSayTheSame) {
  migrate();
  const std::vector<std::string> then = lines_of(test_data("version_6_run_1.csv"));
  const std::vector<std::string> now = lines_of(content_of(exported(cli::ExportFormat::csv)));
  ASSERT_EQ(now.size(), then.size());
  ASSERT_EQ(now.size(), 172U);
  for (std::size_t line = 0; line < now.size(); ++line) EXPECT_THAT(without_t_s(now[line]), StartsWith(then[line]));

  const fs::path earlier = folder_ / "earlier.sqlite";
  make_database(earlier, "version_6_run_1.sql");
  SQLite::Database before{earlier.string(), SQLite::OPEN_READONLY};
  SQLite::Database after{exported(cli::ExportFormat::sqlite).string(), SQLite::OPEN_READONLY};
  const std::vector<std::string> tables = column(before, "SELECT name FROM sqlite_master WHERE type = 'table'");
  EXPECT_EQ(tables.size(), 10U);
  for (const std::string& table : tables) {
    SCOPED_TRACE(table);
    const std::vector<std::string> names = column(before, "SELECT name FROM pragma_table_info('" + table + "')");
    EXPECT_EQ(rows_of(after, table, names), rows_of(before, table, names));
  }
}

// The cause of the latch was stored over that of each event: what it was is not known, and nobody makes it up.
TEST_F(Version6Test, WhatWasOverwrittenStaysAndIsMarked) {
  const std::vector<std::string> before = rows("SELECT kind, cause FROM event ORDER BY event_row");
  migrate();
  EXPECT_EQ(rows("SELECT kind, cause FROM event ORDER BY event_row"), before);
  EXPECT_EQ(number("SELECT count(*) FROM robot_event WHERE emergency_cause IS NULL AND detail = ''"), 17);
  start();
  for (const station::RobotEvent& event : wait(history_->events("nemo", {.limit = 100})).records) {
    EXPECT_FALSE(event.emergency_cause.has_value());
    if (event.kind == "link_lost") EXPECT_EQ(event.cause, "operator");
    if (event.kind == "disconnected") EXPECT_NE(event.cause, "none");
  }
}

TEST_F(Version6Test, TheAuditInAnExportOfThenIsWhole) {
  const fs::path earlier = folder_ / "earlier.sqlite";
  make_database(earlier, "version_6_run_1.sql");
  SQLite::Database exported{earlier.string(), SQLite::OPEN_READONLY};
  const storage::AuditFindings audit = storage::check_exported_audit(exported, {});
  EXPECT_THAT(audit.faults, IsEmpty());
  EXPECT_EQ(audit.entries, 8U);
  EXPECT_EQ(text(audit.head), "11:1a6d83bd6530bf5e1cb5bc9704007110e095ed834ee905b84161eb8a82a4e6fa");
}

TEST_F(Version6Test, AStationGoesOnAndTheChainWithIt) {
  start();
  EXPECT_EQ(restored_.store_id, 14012994835199578285U);
  EXPECT_EQ(wait(runs_->find(2))->state, storage::RunState::interrupted);
  TestRobot robot;
  robot.boot_id = 4712;
  connect(robot);
  make(robot, 100);
  clock_.run_for(5s);  // the run that was cut off gets its digest
  stop();
  const nlohmann::json found = verified();
  EXPECT_THAT(found["faults"], IsEmpty());
  EXPECT_EQ(found["samples"], 332);
  EXPECT_EQ(found["runs_verified"], 2);
  EXPECT_EQ(rows("SELECT run_id, format FROM run_certificate ORDER BY run_id"),
            (std::vector<std::string>{"1|1", "2|2"}));
  EXPECT_EQ(rows("SELECT entry, lower(hex(hash)) FROM audit WHERE entry = 16"),
            std::vector<std::string>{"16|e5bbe54ac3e6058e8193cca138ee726b7d88c7c01102f86036b053229a78b71e"});
  EXPECT_GT(found["audit_entries"].get<int>(), 16);
}

class Version11Test : public Version6Test {
 protected:
  void SetUp() override { make_database(path_, "version_11.sql"); }
};

TEST_F(Version11Test, DigestsAndTheChainVerifyBeforeTheMigrationAndAfterIt) {
  const nlohmann::json before = verified();
  EXPECT_THAT(before["faults"], IsEmpty());
  EXPECT_GT(before["runs_verified"].get<int>(), 3);
  const auto digests = rows("SELECT run_id, format, sha256, made_at_us FROM run_certificate");
  migrate();
  EXPECT_EQ(verified(), before);
  start();
  clock_.run_for(5s);  // what the robots missed is counted
  EXPECT_EQ(rows("SELECT state FROM run JOIN run_certificate USING (run_id) WHERE missed_ticks IS NULL"),
            std::vector<std::string>{"discarded"});
  stop();
  EXPECT_THAT(verified()["faults"], IsEmpty());
  EXPECT_EQ(
      rows("SELECT run_id, format, sha256, made_at_us FROM run_certificate LIMIT " + std::to_string(digests.size())),
      digests);
}

TEST_F(Version11Test, AnExportDiffersByTheNewColumnAlone) {
  migrate();
  const std::vector<std::string> then = lines_of(test_data("version_11_run_3.csv"));
  const std::vector<std::string> now = lines_of(content_of(exported(cli::ExportFormat::csv, 3)));
  ASSERT_EQ(now.size(), then.size());
  for (std::size_t line = 0; line < now.size(); ++line) {
    EXPECT_EQ(now[line].substr(0, now[line].rfind(',')), then[line]);
  }
  EXPECT_THAT(now.front(), ::testing::EndsWith(",missed_ticks_before"));
}

}  // namespace
}  // namespace server
