// Experiments over the routes: begun, watched, kept alive, ended; what is refused, and to whom.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class ExperimentRoutesTest : public ApiTest {
 protected:
  ExperimentRoutesTest() { connect_robot(); }

  static json rest(double for_s = 5) {
    return {{"name", "rest"},
            {"purpose", "nothing moves"},
            {"conditions", {{"start", "here"}}},
            {"step", {{{"kind", "rest"}, {"for_s", for_s}}}}};
  }
  Answered begin_one(const json& profile, const json& more = json::object()) {
    json body{{"robot_id", "r1"}, {"profile", profile}};
    body.update(more);
    return ask("POST", "/api/v1/experiments", body);
  }
  json get(int id) { return ask("GET", fmt::format("/api/v1/experiments/{}", id)).parsed(); }
  // Samples of a robot at rest, and a script that is there.
  void pass(int tenths) {
    for (int i = 0; i < tenths; ++i) {
      make_samples(*robot, next_seq_, 10);
      next_seq_ += 10;
      ask("POST", "/api/v1/experiments/1/keep-alive");
      clock.run_for(100ms);
    }
  }

  std::uint64_t next_seq_ = 0;
};

// SAFETY: a call that was delayed in a network, or a script that has seen nothing for long, keeps nothing moving.
TEST_F(ExperimentRoutesTest, ASignOfLifeIsAsOldAsWhatTheScriptHasSeen) {
  pass(1);
  ASSERT_EQ(begin_one(rest(20)).status, 202);
  const json first = ask("POST", "/api/v1/experiments/1/keep-alive").parsed();
  const std::int64_t seen = seen_us(1).value();
  clock.run_for(500ms);
  const json stamp{{"stamp_us", first.at("stamp_us")}};
  const Answered late = ask("POST", "/api/v1/experiments/1/keep-alive", stamp);
  ASSERT_EQ(late.status, 200) << late.body;
  EXPECT_EQ(seen_us(1), seen) << "it is no sign of life";
  ask("POST", "/api/v1/experiments/1/keep-alive", {{"stamp_us", late.parsed().at("stamp_us")}});
  EXPECT_GT(seen_us(1), seen);
  const auto now_us = seen_us(1);
  clock.run_for(100ms);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/keep-alive", {{"stamp_us", 1LL << 60}}).status, 200);
  EXPECT_EQ(seen_us(1), now_us) << "of an earlier boot of the machine";
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/keep-alive", {{"stamp", 1}}).status, 400);
}

// SAFETY: two programs with one token are two clients.
TEST_F(ExperimentRoutesTest, ASignOfLifeIsOfTheProgramThatBeganIt) {
  client = "script-one";
  ASSERT_EQ(begin_one(rest(20)).status, 202);
  EXPECT_EQ(get(1)["client"], "script-one");
  const std::int64_t seen = seen_us(1).value();
  clock.run_for(100ms);
  for (const char* other : {"script-two", ""}) {
    client = other;
    const Answered refused = ask("POST", "/api/v1/experiments/1/keep-alive");
    EXPECT_EQ(refused.status, 409);
    EXPECT_EQ(refused.parsed()["reason"], "acts_for_another");
    EXPECT_THAT(refused.parsed()["detail"].get<std::string>(), HasSubstr("another page or program of token:local"));
  }
  EXPECT_EQ(seen_us(1), seen);
  client = "script-one";
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/keep-alive").status, 200);
  EXPECT_GT(seen_us(1), seen);
  client = "script-two";
  ASSERT_EQ(ask("POST", "/api/v1/experiments/1/take-over").status, 200);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/keep-alive").status, 200);
  EXPECT_EQ(get(1)["client"], "script-two");
  const json entry = ask("GET", "/api/v1/audit?action=experiment.taken_over").parsed()["entries"][0];
  EXPECT_EQ(entry["detail"]["by"], "token:local, script script-t");
}

TEST_F(ExperimentRoutesTest, WhatTheRobotWouldRefuseEndsItBeforeAnythingBegins) {
  const auto profile = [](const json& step) {
    json made = rest(1);
    made["step"] = json::array({step, {{"kind", "rest"}, {"for_s", 1}}});
    return made;
  };
  const json backwards = profile({{"kind", "duty"}, {"duty", -0.2}, {"for_s", 1}});
  const Answered waits = begin_one(backwards);  // of this robot nothing is known yet
  ASSERT_EQ(waits.status, 202) << waits.body;
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_controller_tag;
  frame.body.controller.controller_id = 2;
  frame.body.controller.period_us = 10'000;
  frame.body.controller.kp = frame.body.controller.direct = 3;
  frame.body.controller.duty_max = 1;  // and duty_min 0: a motor without reverse
  robot->send(frame);
  clock.settle();
  pass(60);
  EXPECT_EQ(get(1)["state"], "aborted");
  EXPECT_EQ(get(1)["reason"], "robot_limits");
  EXPECT_EQ(get(1)["runs"], json::array());
  EXPECT_TRUE(robot->commands().empty());

  const Answered refused = begin_one(backwards);
  EXPECT_EQ(refused.status, 422);
  EXPECT_EQ(refused.parsed()["reason"], "out_of_range");
  EXPECT_THAT(refused.parsed()["detail"].get<std::string>(),
              HasSubstr("step 1: duty = -0.2, and the robot's controller has duty_min = 0"));
  EXPECT_EQ(begin_one(profile({{"kind", "duty"}, {"duty", 0.2}, {"for_s", 1}})).status, 202);
}

TEST_F(ExperimentRoutesTest, IsQueuedRecordedAndShown) {
  clock.run_for(2s);  // this robot says nothing of its limits
  pass(1);
  const Answered begun = begin_one(rest(1), {{"notes", "quiet"}, {"priority", 5}});
  ASSERT_EQ(begun.status, 202) << begun.body;
  EXPECT_EQ(begun.parsed()["runs_planned"], 1);
  EXPECT_EQ(begun.parsed()["priority"], 5);
  EXPECT_EQ(begun.parsed()["acts_for"], "token:local");
  pass(8);  // these samples say 1 m more each: at 100 m it is aborted
  const json now = get(1);
  ASSERT_EQ(now["state"], "running") << now;
  EXPECT_EQ(now["runs"][0]["run_id"], 1);
  EXPECT_EQ(now["run_counts"], (json{{"running", 1}}));
  const json kept = ask("POST", "/api/v1/experiments/1/keep-alive").parsed();
  EXPECT_EQ(kept["run_counts"], (json{{"running", 1}}));
  EXPECT_FALSE(kept.contains("runs")) << "only GET of one gives every run";
  EXPECT_FALSE(ask("GET", "/api/v1/experiments").parsed()["experiments"][0].contains("runs"));
  EXPECT_THAT(now["profile"].get<std::string>(), HasSubstr("nothing moves"));
  const json run = ask("GET", "/api/v1/runs/1").parsed();
  EXPECT_EQ(run["notes"], "quiet");
  EXPECT_EQ(run["profile"], "rest");
  EXPECT_EQ(ask("GET", "/api/v1/experiments?robot_id=r1&state=running").parsed()["experiments"].size(), 1U);
  EXPECT_EQ(ask("GET", "/api/v1/experiments?state=done").parsed()["experiments"].size(), 0U);
  EXPECT_EQ(ask("GET", "/api/v1/experiments/1/runs/2/prediction").status, 404);
}

TEST_F(ExperimentRoutesTest, AWrongDocumentIsRefusedWithItsLineOrKey) {
  const Answered toml = begin_one("name = \"a\"\npurpose = \"b\"\n[[step]]\nkind = \"duty\"\nduty = 3\nfor_s = 1\n");
  EXPECT_EQ(toml.status, 422);
  EXPECT_THAT(toml.parsed()["detail"].get<std::string>(), HasSubstr("profile:5:"));
  json document = rest();
  document["step"][0]["for_s"] = -1;
  EXPECT_THAT(begin_one(document).parsed()["detail"].get<std::string>(), HasSubstr("step[0].for_s"));
  EXPECT_EQ(begin_one("figure_77").status, 404);
  EXPECT_EQ(begin_one(7).status, 400);
  EXPECT_EQ(ask("POST", "/api/v1/experiments", {{"robot_id", "r1"}}).status, 400);
  EXPECT_EQ(begin_one(rest(), {{"priority", 101}}).status, 422);
  EXPECT_EQ(begin_one(rest(), {{"robot_id", "nobody"}}).status, 404);
  EXPECT_EQ(begin_one(rest(), {{"colour", "red"}}).status, 400);
}

TEST_F(ExperimentRoutesTest, UnattendedNeedsTheConfiguration) {
  const Answered refused = begin_one("figure_7", {{"unattended", true}});
  EXPECT_EQ(refused.status, 403);
  EXPECT_EQ(refused.parsed()["reason"], "unattended_not_allowed");
}

TEST_F(ExperimentRoutesTest, WhoMayStopMayEndItAndNobodyElseMayBeginOne) {
  ASSERT_EQ(begin_one(rest()).status, 202);
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(begin_one(rest()).status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/resume").status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/take-over").status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/move", json::object()).status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/keep-alive").status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/abort", {{"reason", "too loud"}}).status, 200);
  EXPECT_EQ(get(1)["state"], "cancelled");
  EXPECT_THAT(get(1)["detail"].get<std::string>(), HasSubstr("too loud"));
}

TEST_F(ExperimentRoutesTest, ARedButtonEndsItAndSeesNothingOfIt) {
  ASSERT_EQ(begin_one(rest()).status, 202);
  scopes = identity::parse_scopes("stop").value();
  const json ended = ask("POST", "/api/v1/experiments/1/abort").parsed();
  EXPECT_EQ(ended, (json{{"experiment_id", 1}, {"state", "cancelled"}}));
}

TEST_F(ExperimentRoutesTest, WhatIsNotThereOrHasEnded) {
  for (const char* act : {"keep-alive", "pause", "resume", "abort", "take-over", "move"}) {
    const json body = std::string{act} == "move" ? json::object() : json(nullptr);
    EXPECT_EQ(ask("POST", fmt::format("/api/v1/experiments/9/{}", act), body).status, 404) << act;
    EXPECT_EQ(ask("POST", fmt::format("/api/v1/experiments/x/{}", act), body).status, 404) << act;
  }
  EXPECT_EQ(ask("GET", "/api/v1/experiments/9").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/experiments?state=odd").status, 400);
  ASSERT_EQ(begin_one(rest()).status, 202);
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/pause").status, 409) << "it waits";
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/resume").status, 409) << "it is not held";
  EXPECT_EQ(ask("POST", "/api/v1/experiments/1/move", {{"before", 9}}).status, 422);
  ASSERT_EQ(ask("POST", "/api/v1/experiments/1/abort").status, 200);
  for (const char* act : {"keep-alive", "pause", "resume", "abort", "take-over", "move"}) {
    const json body = std::string{act} == "move" ? json::object() : json(nullptr);
    const Answered ended = ask("POST", fmt::format("/api/v1/experiments/1/{}", act), body);
    EXPECT_EQ(ended.status, 409) << act;
    EXPECT_EQ(ended.parsed()["reason"], "wrong_state") << act;
  }
}

TEST_F(ExperimentRoutesTest, APageGivesNoSignOfLifeByARequest) {
  session = 3;
  pass(1);
  ASSERT_EQ(begin_one(rest()).status, 202);
  pass(10);
  EXPECT_EQ(get(1)["waits_for"], "nobody_present") << "SAFETY: only its stamps on /live do";
}

TEST_F(ExperimentRoutesTest, TheProfilesOfTheProgram) {
  const json list = ask("GET", "/api/v1/experiment-profiles").parsed()["profiles"];
  ASSERT_GE(list.size(), 7U);
  const json one = ask("GET", "/api/v1/experiment-profiles/figure_7").parsed();
  EXPECT_THAT(one["document"].get<std::string>(), HasSubstr("disturbance_m = -0.05"));
  EXPECT_EQ(ask("GET", "/api/v1/experiment-profiles/none").status, 404);
  EXPECT_EQ(begin_one(one["document"]).status, 202) << "it can be sent as it is";
}

}  // namespace
}  // namespace server
