// What verify answers, and that it changes nothing.
#include <gmock/gmock.h>

#include "server/recording/schema.hpp"
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
    const RunId run = wait(runs_->create(robot.id, named("one")))->id;
    make(robot, 250);
    ASSERT_TRUE(wait(runs_->end(run, "")).has_value());
    ASSERT_TRUE(wait(recording_->certifier.find(run))->is_final);
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

TEST_F(VerifyTest, ADatabaseThatIsNotThereOrForeignOrOldIsToldApart) {
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

TEST_F(VerifyTest, ChecksAFileThatIsNamed) {
  record();
  stop();
  std::filesystem::copy_file(path_, folder_ / "copy.sqlite");
  change("UPDATE sample SET duty = 0.5 WHERE row = 7");
  const auto copy = cli::ask_tool(folder_, "verify --file @copy.sqlite");
  EXPECT_EQ(copy.exit_code, 0) << copy.text;
  EXPECT_EQ(ask().exit_code, 1);
}

}  // namespace
}  // namespace server
