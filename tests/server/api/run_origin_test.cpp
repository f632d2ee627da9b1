// What a run was made with: its experiment, the profile that was performed, the controller and its model, both ways.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>

#include "server/analysis/capsule/archive_reader.hpp"
#include "server/runtime/sha256.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class RunOriginTest : public ApiTest {
 protected:
  RunOriginTest() {
    connect_robot();
    controller_.controller_id = 2;
    controller_.period_us = 10'000;
    controller_.kp = 65;
    controller_.duty_min = -1;
    controller_.duty_max = 1;
    controller_.checksum = 0x0000'65FF;
    report(controller_);
    const json model{{"kp", 0.1}, {"b1", 0.0057}, {"b2", 0.11}, {"alpha", 1.7}, {"beta", 0.87}};
    keep({{"kind", "model"}, {"name", "softener <fit>"}, {"document", model}});
    const json law{{"kp", 29.971237}, {"kd", 0.10523527}, {"mu", 0.94550043}};
    keep({{"kind", "controller"}, {"name", "3 rad/s"}, {"document", law}, {"model_id", 1}});
  }

  void keep(const json& design) { ASSERT_EQ(ask("POST", "/api/v1/designs", design).status, 201); }
  void report(const protocol::Controller& controller) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_controller_tag;
    frame.body.controller = controller;
    robot->send(frame);
    clock.settle();
  }
  // The robot takes the design's controller and reports it.
  void push(int design) {
    const auto asked = begin("POST", "/api/v1/robots/r1/controller", {{"design_id", design}});
    ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 5s));
    controller_ = robot->commands().back().action.set_controller;
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
    report(controller_);
    ASSERT_EQ(end(asked).status, 200);
    answered_ = robot->commands().size();
  }
  // One second of rest as an experiment, to its end.
  void perform() {
    pass(1);
    const json profile{{"name", "rest"},
                       {"purpose", "nothing moves"},
                       {"conditions", {{"start", "here"}}},
                       {"step", {{{"kind", "rest"}, {"for_s", 1}}}}};
    const Answered begun = ask("POST", "/api/v1/experiments", {{"robot_id", "r1"}, {"profile", profile}});
    ASSERT_EQ(begun.status, 202) << begun.body;
    const auto has_ended = [this] { return ask("GET", "/api/v1/runs/1").parsed()["state"] == "ended"; };
    for (int tries = 0; tries < 60 && !has_ended(); ++tries) pass(5);
    ASSERT_TRUE(has_ended()) << ask("GET", "/api/v1/experiments/1").body;
  }
  void pass(int tenths) {
    for (int i = 0; i < tenths; ++i) {
      make_samples(*robot, next_seq_, 10);
      next_seq_ += 10;
      for (; answered_ < robot->commands().size(); ++answered_) {
        robot->acknowledge(robot->commands()[answered_], rheonaut_COMMAND_RESULT_ACCEPTED);
      }
      ask("POST", "/api/v1/experiments/1/keep-alive");
      clock.run_for(100ms);
    }
  }
  json runs_made_with(int design) {
    return ask("GET", fmt::format("/api/v1/designs/{}", design)).parsed()["runs_made_with"];
  }
  json document_in_capsule(const std::string& name) {
    const Answered answered = ask("GET", "/api/v1/runs/1/capsule.eln");
    const auto file = folder.path() / "run.eln";
    std::ofstream{file, std::ios::binary} << answered.body;
    return json::parse(analysis::ArchiveReader{file}.text("run-1/" + name, 1'000'000).value());
  }

  protocol::Controller controller_ = rheonaut_Controller_init_zero;
  std::uint64_t next_seq_ = 0;
  std::size_t answered_ = 0;  // of the robot's commands
};

TEST_F(RunOriginTest, ARunNamesItsExperimentAndTheProfileThatWasPerformedForGood) {
  perform();
  const json experiment = ask("GET", "/api/v1/experiments/1").parsed();
  const json origin{{"experiment_id", 1},
                    {"number", 1},
                    {"profile_sha256", runtime::sha256_of(experiment["profile"].get<std::string>())}};
  EXPECT_EQ(ask("GET", "/api/v1/runs/1").parsed()["experiment"], origin);
  {
    SQLite::Database other{recorder.path().string(), SQLite::OPEN_READWRITE};
    other.exec("DELETE FROM experiment_run; DELETE FROM experiment");  // only the newest 10,000 are kept
  }
  EXPECT_EQ(ask("GET", "/api/v1/runs").parsed()["runs"][0]["experiment"], origin);
  const json performed = document_in_capsule("experiment.json");
  EXPECT_EQ(performed["profile"], experiment["profile"]);
  EXPECT_EQ(performed["profile_sha256"], origin["profile_sha256"]);
  EXPECT_EQ(performed["experiment_id"], 1);
  EXPECT_EQ(performed["variant"]["repeat"], 1);
  EXPECT_EQ(document_in_capsule("run.json")["experiment"], origin);
}

TEST_F(RunOriginTest, ARunAndItsControllerNameEachOther) {
  EXPECT_EQ(runs_made_with(2), json::array());
  push(2);
  EXPECT_EQ(runs_made_with(2), json::array()) << "no run began since";
  perform();
  EXPECT_EQ(runs_made_with(2), json::array({1}));
  EXPECT_EQ(runs_made_with(1), json::array({1})) << "a model's are those of its controllers";
  const json made_with = document_in_capsule("designs.json")["made_with"];
  ASSERT_EQ(made_with.size(), 1U);
  EXPECT_EQ(made_with[0]["design_id"], 2);
  EXPECT_EQ(made_with[0]["document"]["kp"], 29.971237);
  EXPECT_EQ(made_with[0]["model"]["document"]["alpha"], 1.7);
  const std::string report = ask("GET", "/api/v1/runs/1/report.html").body;
  EXPECT_THAT(report, HasSubstr("<h2>Made with</h2>\n<p>Run 1 of experiment 1, profile “rest”, SHA-256 <code>"));
  EXPECT_THAT(report, HasSubstr("<td>2: 3 rad/s<br><code>"));
  EXPECT_THAT(report, HasSubstr("<td>1: softener &lt;fit&gt;</td>"));
}

TEST_F(RunOriginTest, AnotherControllerIsNotTheDesigns) {
  push(2);
  controller_.checksum += 1;
  report(controller_);
  perform();
  EXPECT_EQ(runs_made_with(2), json::array());
  EXPECT_EQ(document_in_capsule("designs.json")["made_with"], json::array());
  EXPECT_THAT(ask("GET", "/api/v1/runs/1/report.html").body, HasSubstr("No controller that the station keeps"));
}

TEST_F(RunOriginTest, ARunByHandHasNoExperiment) {
  pass(1);
  ASSERT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "by hand"}}).status, 201);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1").parsed()["experiment"], nullptr);
  EXPECT_THAT(ask("GET", "/api/v1/runs/1/report.html").body, Not(HasSubstr("Made with")));
}

// What was not noted would make a run whose controller nobody can name.
TEST_F(RunOriginTest, NothingIsSentThatCannotBeNoted) {
  SQLite::Database other = lock_disk();
  const Answered refused = end(begin("POST", "/api/v1/robots/r1/controller", {{"design_id", 2}}), 30s);
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.parsed()["reason"], "not_stored");
  EXPECT_TRUE(robot->commands().empty());
}

}  // namespace
}  // namespace server
