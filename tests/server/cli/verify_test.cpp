// What verify answers, and that it changes nothing.
#include <gmock/gmock.h>

#include "server/storage/database/schema.hpp"
#include "tests/server/cli/tool_test.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using cli::ToolAnswer;
using ::testing::HasSubstr;

class VerifyTest : public RecordingTest {
 protected:
  ToolAnswer ask(const std::string& flags = "") { return cli::ask_tool(folder_, "verify --data @. " + flags); }
  void change(const std::string& sql) {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE, 5000};
    database.exec(sql);
  }
  void record() {
    TestRobot robot;
    start();
    connect(robot);
    const storage::RunId run = wait(runs_->create(robot.id, named("one")))->id;
    make(robot, 250);
    ASSERT_TRUE(wait(runs_->end(run, "")).has_value());
    ASSERT_TRUE(wait(recording_->digester.find(run))->is_final);
  }
};

TEST_F(VerifyTest, SaysThatAllIsWellBesideTheStationAndAfterIt) {
  record();
  EXPECT_EQ(ask().exit_code, 0);
  stop();
  const ToolAnswer answer = ask("--json");
  EXPECT_EQ(answer.exit_code, 0);
  EXPECT_EQ(answer.json()["faults"].size(), 0u);
  EXPECT_EQ(answer.json()["runs_verified"], 1);
  EXPECT_EQ(answer.json()["samples"], 250);
  EXPECT_EQ(answer.json()["integrity_checked"], true);
  EXPECT_THAT(ask().text, HasSubstr("no faults"));
}

TEST_F(VerifyTest, NamesEachFaultInALine) {
  record();
  stop();
  change("UPDATE sample SET duty = 0.5 WHERE row = 7");
  const ToolAnswer answer = ask();
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.text, HasSubstr("fault: run 1: its samples were changed"));
  EXPECT_EQ(ask("--run 1 --json").json()["faults"].size(), 1u);
}

TEST_F(VerifyTest, ADatabaseThatIsNotThereOrForeignOrOldIsDistinguished) {
  EXPECT_EQ(ask().exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(path_));
  std::ofstream{path_} << "not a database, but long enough to be looked at as one";
  EXPECT_EQ(ask().exit_code, 2);
  std::filesystem::remove(path_);
  record();
  stop();
  EXPECT_EQ(ask("--run 9").exit_code, 2);
  change("PRAGMA user_version = 1");
  EXPECT_EQ(ask().exit_code, 2);
  change("PRAGMA user_version = 2; PRAGMA application_id = 1");
  EXPECT_EQ(ask().exit_code, 2);
}

TEST_F(VerifyTest, ADatabaseThatLostItsLogIsAFault) {
  TestRobot robot;
  start();
  connect(robot);
  make_slowly(robot, 500);
  EXPECT_EQ(ask().exit_code, 0) << "beside the station";
  std::filesystem::copy_file(path_, folder_ / "without_log.sqlite");
  kill();
  std::filesystem::rename(folder_ / "without_log.sqlite", path_);
  const ToolAnswer lost = ask();
  EXPECT_EQ(lost.exit_code, 1);
  EXPECT_THAT(lost.text, HasSubstr("fault: the database has lost commits"));
  EXPECT_EQ(ask("--run 1").exit_code, 2) << "a run alone is not the whole store: there is none";
  start();
  EXPECT_THAT(ask("--audit").text, HasSubstr("fault: not acknowledged: the database has lost commits"));
  EXPECT_EQ(ask("--json").json()["faults"].size(), 1U);
  ASSERT_TRUE(wait(recording_->head_watch.acknowledge({"user:anna", "", 1})));
  EXPECT_EQ(ask().exit_code, 0);
  stop();
  std::ofstream{folder_ / "station.head.json"} << "no head";
  EXPECT_THAT(ask().text, HasSubstr("cannot be told"));
}

TEST_F(VerifyTest, ChecksAFileThatIsNamed) {
  record();
  stop();
  std::filesystem::copy_file(path_, folder_ / "copy.sqlite");
  change("UPDATE sample SET duty = 0.5 WHERE row = 7");
  const auto copy = cli::ask_tool(folder_, "verify --file @copy.sqlite");
  EXPECT_EQ(copy.exit_code, 0) << copy.text;
  EXPECT_EQ(ask().exit_code, 1);
}

TEST_F(VerifyTest, ReadsTheAuditAndPrintsItsHead) {
  record();
  stop();
  const ToolAnswer answer = ask("--audit --json");
  EXPECT_EQ(answer.exit_code, 0) << answer.text;
  EXPECT_EQ(answer.json()["faults"].size(), 0u);
  EXPECT_FALSE(answer.json().contains("segments")) << "only the audit";
  const std::string head = answer.json()["audit_head"];
  EXPECT_TRUE(head.starts_with(answer.json()["audit_entries"].dump() + ":")) << head;
  EXPECT_THAT(ask("--audit").text, HasSubstr("head      " + head));
  EXPECT_THAT(ask().text, HasSubstr("head      " + head)) << "without options, too";
  EXPECT_EQ(ask("--audit --expect " + head).exit_code, 0);
  change("DROP TRIGGER audit_kept; DELETE FROM audit WHERE entry = (SELECT max(entry) FROM audit)");
  EXPECT_THAT(ask("--audit").text, HasSubstr("fault: the database has lost commits")) << "the head beside it says so";
  std::filesystem::remove(folder_ / "station.head.json");
  EXPECT_EQ(ask("--audit").exit_code, 0) << "nothing says that there was more";
  const ToolAnswer cut = ask("--expect " + head);
  EXPECT_EQ(cut.exit_code, 1);
  EXPECT_THAT(cut.text, HasSubstr("what came after was removed"));
  change("DROP TRIGGER audit_unchanged; UPDATE audit SET peer = 'x' WHERE entry = 2");
  EXPECT_THAT(ask().text, HasSubstr("fault: audit: entry 2 was changed"));
  EXPECT_NE(ask("--audit --run 1").exit_code, 0);
}

TEST_F(VerifyTest, TheExportOfARunIsVerifiedByItsPartOfTheAudit) {
  record();
  stop();
  ASSERT_EQ(cli::ask_tool(folder_, "export --run 1 --format sqlite --to @run.sqlite --data @.").exit_code, 0);
  const auto verify = [this](const std::string& flags) {
    return cli::ask_tool(folder_, "verify --file @run.sqlite" + flags);
  };
  const ToolAnswer answer = verify(" --audit --json");
  EXPECT_EQ(answer.exit_code, 0) << answer.text << answer.error;
  EXPECT_GE(answer.json()["audit_entries"], 2);
  EXPECT_EQ(verify("").exit_code, 2) << "an export has nothing else to verify";
  SQLite::Database file{(folder_ / "run.sqlite").string(), SQLite::OPEN_READWRITE};
  file.exec("UPDATE audit SET subject = 'x' WHERE action = 'run.made'");
  EXPECT_EQ(verify(" --audit").exit_code, 1);
  file.exec("PRAGMA user_version = 1");
  EXPECT_EQ(verify(" --audit").exit_code, 2) << "of a version without an audit";
}

}  // namespace
}  // namespace server
