// The queries of docs/database.md work as they stand, with the stock sqlite3 program.
#include <array>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

#include "server/storage/database/schema.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

// The blocks between ```sql and ```.
std::vector<std::string> documented_queries() {
  std::ifstream document{DATABASE_DOCUMENT};
  std::vector<std::string> queries;
  bool inside = false;
  for (std::string line; std::getline(document, line);) {
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

  Answer ask(const std::string& query) {
    std::ofstream{folder_ / "query.sql"} << query;
    const std::string command =
        "sqlite3 -readonly -bail -list '" + path_.string() + "' < '" + (folder_ / "query.sql").string() + "' 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    Answer answer;
    std::array<char, 4096> buffer{};
    for (std::size_t size = 0; (size = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) {
      answer.output.append(buffer.data(), size);
    }
    answer.status = pclose(pipe);
    return answer;
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
    recorder_->on_event(state_of(robot, station::LinkState::connected), event);
    station::CommandRecord command;
    command.id = ~0ULL;
    command.robot_id = robot.id;
    recorder_->on_command(command);
    station::AuditNote refused;
    refused.action = "command.refused";
    refused.detail = R"({"problem":"duty = 7 is outside -1 to 1"})";
    recorder_->on_audit(refused);
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
