// The stop of all over HTTP: its summary, and robots that an administrator has retired.
#include <gmock/gmock.h>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class StopOfAllTest : public ApiTest {
 protected:
  // The station knows so many robots, which are not connected.
  void know(int count) {
    std::vector<station::RestoredRobot> known;
    for (int i = 1; i <= count; ++i) known.push_back({.id = fmt::format("away-{:03}", i)});
    station.restore(known, {});
  }
  // In the database, too.
  void enrol(const char* robot_id) {
    ASSERT_EQ(ask("POST", "/api/v1/enrolments", {{"robot_id", robot_id}}).status, 201);
  }
  Answered retire(const std::string& robot_id, const json& retired) {
    return ask("POST", "/api/v1/robots/" + robot_id + "/retire", {{"retired", retired}});
  }
  json stop_all() {
    const Answered answered = ask("POST", "/api/v1/emergency-stop");
    EXPECT_EQ(answered.status, 202) << answered.body;
    return answered.parsed();
  }
  std::vector<std::string> stopped() {
    const json answer = stop_all();
    std::vector<std::string> ids;
    for (const json& command : answer["commands"]) ids.push_back(command["robot_id"]);
    return ids;
  }
};

TEST_F(StopOfAllTest, TheAnswerBeginsWithASummaryThatNamesThoseThatDidNotAcknowledge) {
  connect_robot();
  know(2);
  const auto asked = begin("POST", "/api/v1/emergency-stop");
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  const Answered answered = end(asked);
  EXPECT_EQ(answered.status, 202) << "two are kept";
  EXPECT_TRUE(
      answered.body.starts_with(R"({"summary":{"robots":3,"acknowledged":1,"unanswered":0,"failed":0,"kept":2,)"))
      << answered.body;
  const json summary = answered.parsed()["summary"];
  EXPECT_EQ(summary["left_out"], 0);
  EXPECT_EQ(summary["not_named"], 0);
  EXPECT_EQ(summary["not_acknowledged"], json::parse(R"([{"robot_id":"away-001","outcome":"kept"},
                                                         {"robot_id":"away-002","outcome":"kept"}])"));
  EXPECT_EQ(answered.parsed()["commands"].size(), 3U);
}

TEST_F(StopOfAllTest, AConnectedRobotThatDoesNotAnswerIsNamedFirst) {
  know(2);
  connect_robot();
  const json summary = stop_all()["summary"];
  EXPECT_EQ(summary["unanswered"], 1);
  EXPECT_EQ(summary["not_acknowledged"][0], json::parse(R"({"robot_id":"r1","outcome":"unanswered"})"));
}

TEST_F(StopOfAllTest, ItNamesAHundredRobotsAndCountsTheRest) {
  know(621);
  const json summary = stop_all()["summary"];
  EXPECT_EQ(summary["kept"], 621);
  EXPECT_EQ(summary["not_acknowledged"].size(), 100U);
  EXPECT_EQ(summary["not_named"], 521);
}

TEST_F(StopOfAllTest, ARetiredRobotIsLeftOutUntilItConnects) {
  connect_robot();
  enrol("r2");
  robot->link.cut();
  ASSERT_TRUE(clock.run_until([&] { return station.find("r1")->link == station::LinkState::disconnected; }, 2s));
  clock.run_for(10ms);
  const Answered retired = retire("r1", true);
  EXPECT_EQ(retired.status, 200) << retired.body;
  EXPECT_EQ(retired.parsed()["retired_by"], "token:local");
  EXPECT_EQ(retired.parsed()["retired_at_us"], clock.utc_us());
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["retired"], true);
  EXPECT_EQ(ask("GET", "/api/v1/robots").parsed()["robots"].size(), 2U) << "it stays listed";
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1/events").parsed()["events"][0]["kind"], "retired");
  clock.run_for(61s);  // it may move no more
  EXPECT_THAT(stopped(), ElementsAre("r2"));
  EXPECT_EQ(stop_all()["summary"]["left_out"], 1);
  const auto before = std::move(robot);
  connect_robot();
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["retired"], true);
  EXPECT_THAT(stopped(), ElementsAre("r1", "r2"));
}

TEST_F(StopOfAllTest, ARobotIsPutBackIntoUse) {
  enrol("r2");
  ASSERT_EQ(retire("r2", true).status, 200);
  clock.run_for(61s);
  EXPECT_THAT(ask("POST", "/api/v1/emergency-stop").parsed()["commands"], IsEmpty());
  EXPECT_EQ(retire("r2", false).parsed()["retired_at_us"], nullptr);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r2").parsed()["retired"], false);
  EXPECT_THAT(stopped(), ElementsAre("r2"));
  const json audit = ask("GET", "/api/v1/audit?robot_id=r2&action=robot").parsed()["entries"];
  std::vector<std::string> actions;
  for (const json& entry : audit) actions.push_back(entry["action"]);
  EXPECT_THAT(actions, ElementsAre("robot.unretired", "robot.retired", "robot.enrolled"));
}

TEST_F(StopOfAllTest, WhatCannotBeRetiredIsRefused) {
  enrol("r2");
  EXPECT_EQ(retire("nobody", true).status, 404);
  EXPECT_EQ(retire("r2", "yes").status, 400);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r2/retire", json::object()).status, 400);
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(retire("r2", true).status, 403);
  scopes = identity::Scopes::of(identity::Role::admin);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r2").parsed()["retired"], false);
}

}  // namespace
}  // namespace server
