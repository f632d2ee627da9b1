// The queries of docs/database.md work as they stand, with the stock sqlite3 program: on a station's database, and
// those over views on an exported run too.
#include <array>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

#include "server/storage/database/database.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

// The heading of those that need a station's tables.
constexpr const char* kOfAStation = "### Only in a station's database";

// The blocks between ```sql and ```, up to that line.
std::vector<std::string> documented_queries(const std::string& end = "") {
  std::ifstream document{DATABASE_DOCUMENT};
  std::vector<std::string> queries;
  bool inside = false;
  for (std::string line; std::getline(document, line);) {
    if (!end.empty() && line == end) break;
    if (line == "```sql") {
      queries.emplace_back();
      inside = true;
    } else if (line == "```") {
      inside = false;
    } else if (inside) {
      queries.back() += line + "\n";
    }
  }
  return queries;
}

TEST(DatabaseDocument, NamesTheSchemasVersion) {
  std::ifstream document{DATABASE_DOCUMENT};
  const std::string text{std::istreambuf_iterator<char>{document}, {}};
  const std::string version = "the schema's version, " + std::to_string(storage::migrations().size()) + " at present";
  EXPECT_NE(text.find(version), std::string::npos) << version;
}

class DocumentedQueries : public RecordingTest {
 protected:
  struct Answer {
    int status = 0;
    std::string output;  // and errors
  };

  Answer ask(const std::string& query) { return ask(path_, query); }
  Answer ask(const std::filesystem::path& database, const std::string& query) {
    std::ofstream{folder_ / "query.sql"} << query;
    const std::string command =
        "sqlite3 -readonly -bail -list '" + database.string() + "' < '" + (folder_ / "query.sql").string() + "' 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    Answer answer;
    std::array<char, 4096> buffer{};
    for (std::size_t size = 0; (size = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) {
      answer.output.append(buffer.data(), size);
    }
    answer.status = pclose(pipe);
    return answer;
  }

  std::filesystem::path exported() {
    auto spans = wait(recording_->exports.spans(storage::excerpt_of(1))).value();
    for (storage::RecordedSpan& span : spans) span.cut(span.made());
    SQLite::Database database = storage::open_for_reading(path_);
    storage::RunFile writer{folder_ / "run-1.sqlite", storage::reading_uri(path_, false), std::move(spans),
                            storage::ExportQuery{.run = 1, .channels = storage::all_channels(), .grid_us = {}}};
    while (writer.advance(database)) continue;
    return folder_ / "run-1.sqlite";
  }

  // One run of 300 samples with a gap, an event, a command and a marker.
  void record() {
    TestRobot robot;
    robot.context.mode = rheonaut_MODE_AUTO;
    robot.context.setpoint_m = 0.1F;
    start();
    connect(robot);
    make(robot, 25);
    ASSERT_TRUE(wait(runs_->create(robot.id, named("closed loop"))).has_value());
    make(robot, 160);
    robot.next_seq += 20;
    robot.oldest_seq = robot.next_seq;
    make(robot, 120);
    station::RobotEvent event;
    event.robot_id = robot.id;
    event.kind = "connected";
    event.received_at_us = clock_.utc_us();
    recorder_->on_event(state_of(robot, station::LinkState::connected), event);
    station::CommandRecord command;
    command.id = ~0ULL;
    command.robot_id = robot.id;
    command.submitted_at_us = clock_.utc_us();
    recorder_->on_command(command);
    station::AuditNote refused;
    refused.action = "command.refused";
    refused.robot_id = robot.id;
    refused.detail = R"({"problem":"duty = 7 is outside -1 to 1"})";
    recorder_->on_audit(refused);
    recorder_->on_in_force(station::RobotState{}, {.boot_id = robot.boot_id,
                                                   .is_change = false,
                                                   .first_seq = 0,
                                                   .content = station::ReportedParameters{{"a", {}}},
                                                   .noticed_at_us = clock_.utc_us()});
    for (const std::uint64_t robot_time_us : {100'000ULL, 700'000ULL, 1'500'000ULL, 99'000'000ULL}) {
      station::ClockRecord estimate;
      estimate.boot_id = robot.boot_id;
      estimate.robot_time_us = robot_time_us;
      estimate.utc_offset_us = 1'700'000'000'000'000;
      recorder_->on_clock(station::RobotState{}, estimate);
    }
    flush();
    ASSERT_TRUE(wait(recording_->markers.add({robot.id, "glucose in", "", std::nullopt, robot.boot_id})).has_value());
  }
};

TEST_F(DocumentedQueries, AllRunAndAnswerWhileTheStationRecords) {
  record();
  const std::vector<std::string> queries = documented_queries();
  EXPECT_GE(queries.size(), 10u);
  for (const std::string& query : queries) {
    SCOPED_TRACE(query);
    const Answer answer = ask(query);
    EXPECT_EQ(answer.status, 0) << answer.output;
    EXPECT_FALSE(answer.output.empty());
  }
}

TEST_F(DocumentedQueries, ThoseOverViewsRunOnAnExportedRun) {
  record();
  const std::filesystem::path file = exported();
  const std::vector<std::string> queries = documented_queries(kOfAStation);
  EXPECT_GE(queries.size(), 10u);
  EXPECT_LT(queries.size(), documented_queries().size()) << "the heading is no longer there";
  for (const std::string& query : queries) {
    SCOPED_TRACE(query);
    const Answer answer = ask(file, query);
    EXPECT_EQ(answer.status, 0) << answer.output;
    EXPECT_FALSE(answer.output.empty());
  }
}

TEST_F(DocumentedQueries, AnExportedRunHasTheStationsViewsWithTheSameRows) {
  record();
  const std::filesystem::path file = exported();
  const std::string views =
      "SELECT made.name, field.name FROM sqlite_schema AS made, pragma_table_info(made.name) AS field"
      " WHERE made.type = 'view' ORDER BY made.name, field.cid";
  EXPECT_EQ(ask(file, views).output, ask(views).output);
  EXPECT_NE(ask(views).output.find("run_sample|run_id\n"), std::string::npos);
  for (const char* view : {"run_sample", "run_gap", "run_marker", "run_in_force"}) {
    SCOPED_TRACE(view);
    const std::string rows = std::string{"SELECT * FROM "} + view + " WHERE run_id = 1";
    EXPECT_EQ(ask(file, rows).output, ask(rows).output);
    EXPECT_FALSE(ask(file, rows).output.empty());
  }
  for (const char* view : {"robot_boot", "robot_command"}) {
    SCOPED_TRACE(view);
    const std::string rows = std::string{"SELECT * FROM "} + view;
    EXPECT_EQ(ask(file, rows).output, ask(rows).output);
    EXPECT_FALSE(ask(file, rows).output.empty());
  }
  // Of the estimates the last one before the run, and those within it.
  const std::string of_the_run = "SELECT * FROM boot_clock WHERE robot_time_us BETWEEN 700000 AND 1500000";
  EXPECT_EQ(ask(file, "SELECT * FROM boot_clock").output, ask(of_the_run).output);
  EXPECT_FALSE(ask(of_the_run).output.empty());
  EXPECT_EQ(ask(file, "SELECT samples, cause FROM robot_gap").output,
            ask("SELECT samples, cause FROM robot_gap").output);
}

TEST_F(DocumentedQueries, RunSampleGivesEverySampleOfTheRunInOrder) {
  record();
  EXPECT_EQ(ask("SELECT count(*), min(seq), max(seq) FROM run_sample WHERE run_id = 1").output, "280|25|324\n");
  const Answer answer =
      ask("SELECT boot_id, seq, robot_time_us, utc_us, position_m, mode, setpoint_m, emergency_id"
          " FROM run_sample WHERE run_id = 1 LIMIT 1");
  EXPECT_EQ(answer.output,
            "18364758544493064720|25|750000|1700000000750000|0.025000000372529|auto|0.100000001490116|0\n");
  std::istringstream lines{ask("SELECT seq FROM run_sample WHERE run_id = 1").output};
  std::uint64_t before = 0;
  for (std::uint64_t seq = 0; lines >> seq; before = seq) EXPECT_LT(before, seq);
  EXPECT_EQ(ask("SELECT command_id FROM robot_command").output, "18446744073709551615\n");
}

}  // namespace
}  // namespace server
