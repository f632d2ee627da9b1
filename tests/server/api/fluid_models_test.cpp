// Models of fluids over HTTP: which are kept, which are refused, and what a robot's document says of them.
#include <gmock/gmock.h>

#include <cmath>

#include "server/api/bodies/fluid_model_body.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kModel = "/api/v1/fluids/water/model";
constexpr const char* kFluidOfRobot = "/api/v1/robots/r1/fluid";

// As `rheonaut estimator --json` prints it.
json printed() {
  return json::parse(R"({"model_gain_m_s": [0.1, -0.33333334, 0, 10], "model_time_constant_s": [0.03, 0.5, 3, 1000],
                         "fit_error": 0.0021, "plant": {"kp": 0.13, "b1": 0.05}})");
}

class FluidModelsRouteTest : public ApiTest {
 protected:
  FluidModelsRouteTest() : ApiTest{config::parse_config("[fluids.oil]\n", "test.toml")} { connect_robot(); }
  json model_of(const std::string& wanted) {
    for (const json& fluid : ask("GET", "/api/v1/fluids").parsed()["fluids"]) {
      if (fluid["fluid"] == wanted) return fluid["model"];
    }
    return "no such fluid";
  }
};

TEST(ParseFluidModel, TakesWhatTheToolPrintsAndKeepsTheFloatsAndTheRest) {
  json body = printed();
  body["comment"] = "at 20 °C";
  body["model_gain_m_s"][2] = -0.0;
  const auto model = api::parse_fluid_model(body.dump());
  ASSERT_TRUE(model) << model.error().detail;
  EXPECT_THAT(model->gain_m_s, ElementsAre(0.1F, -0.33333334F, 0.0F, 10.0F));
  EXPECT_THAT(model->time_constant_s, ElementsAre(0.03F, 0.5F, 3.0F, 1000.0F));
  EXPECT_FALSE(std::signbit(model->gain_m_s[2]));
  EXPECT_EQ(model->fit_error, 0.0021);
  EXPECT_EQ(json::parse(model->document)["plant"]["kp"], 0.13);
  EXPECT_EQ(api::to_json(*model)["comment"], "at 20 °C");
  EXPECT_EQ(api::to_json(*model)["model_gain_m_s"][1], -0.33333334) << "the shortest decimal of what is sent";
}

TEST(ParseFluidModel, RefusesWhatARobotWouldRefuseAndAFitThatMakesItsUncertaintyALie) {
  struct Case {
    const char* member;
    json value;
    ErrorCode code;
    const char* words;
  };
  const Case cases[] = {
      {"model_gain_m_s", {1, 2, 3}, ErrorCode::bad_request, "must be a list of 4 numbers"},
      {"model_gain_m_s", {1, 2, 3, 4, 5}, ErrorCode::bad_request, "must be a list of 4 numbers"},
      {"model_gain_m_s", {1, 2, 3, "4"}, ErrorCode::bad_request, "must be a list of 4 numbers"},
      {"model_gain_m_s", 1, ErrorCode::bad_request, "must be a list of 4 numbers"},
      {"model_gain_m_s", {1, 2, 3, 10.01}, ErrorCode::invalid, "model_gain_m_s[3] = 10.01 is outside -10 to 10"},
      {"model_gain_m_s", {-10.01, 2, 3, 4}, ErrorCode::invalid, "model_gain_m_s[0] = -10.01"},
      {"model_gain_m_s", {1e300, 2, 3, 4}, ErrorCode::invalid, "outside -10 to 10"},
      {"model_time_constant_s", {0.0009, 1, 1, 1}, ErrorCode::invalid, "outside 0.001 to 1000"},
      {"model_time_constant_s", {1, 1, 1, 1001}, ErrorCode::invalid, "model_time_constant_s[3] = 1001"},
      {"fit_error", 0.0051, ErrorCode::invalid, "more than 0.5 % of the final velocity"},
      {"fit_error", -0.001, ErrorCode::invalid, "is negative"},
      {"fit_error", "0.001", ErrorCode::bad_request, "fit_error"},
      {"plant", "plant.json", ErrorCode::bad_request, "plant must be an object"},
      {"gain", 1, ErrorCode::bad_request, "\"gain\" is not known here"},
      {"comment", std::string(20'000, 'x'), ErrorCode::invalid, "comment has 20000 bytes"},
      {"plant", {{"x", std::string(20'000, 'x')}}, ErrorCode::invalid, "bytes together"},
  };
  for (const Case& bad : cases) {
    json body = printed();
    body[bad.member] = bad.value;
    const auto model = api::parse_fluid_model(body.dump());
    ASSERT_FALSE(model) << bad.words;
    EXPECT_EQ(model.error().code, bad.code) << model.error().detail;
    EXPECT_THAT(model.error().detail, HasSubstr(bad.words));
  }
  for (const char* missing : {"model_gain_m_s", "model_time_constant_s", "fit_error"}) {
    json body = printed();
    body.erase(missing);
    EXPECT_EQ(api::parse_fluid_model(body.dump()).error().reason, "missing_member") << missing;
  }
}

TEST_F(FluidModelsRouteTest, IsKeptForItsFluidAndListed) {
  EXPECT_EQ(model_of("water"), nullptr);
  const Answered set = ask("POST", "/api/v1/fluids/%20Water/model", printed());
  ASSERT_EQ(set.status, 200) << set.body;
  EXPECT_EQ(set.parsed()["fluid"], "water");
  EXPECT_EQ(set.parsed()["robots_not_updated"], json::array());
  const json listed = model_of("water");
  EXPECT_EQ(listed["model_gain_m_s"], printed()["model_gain_m_s"]);
  EXPECT_EQ(listed["fit_error"], 0.0021);
  EXPECT_EQ(listed["plant"]["kp"], 0.13);
  EXPECT_GT(listed["set_at_us"], 0);
  EXPECT_EQ(model_of("oil"), nullptr);

  EXPECT_EQ(ask("POST", kModel + std::string{"/remove"}, json::object()).status, 200);
  EXPECT_EQ(model_of("water"), nullptr);
  EXPECT_EQ(ask("POST", kModel + std::string{"/remove"}, json::object()).status, 404);
  const json entries = ask("GET", "/api/v1/audit?action=fluid").parsed()["entries"];
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[0]["action"], "fluid.model_removed");
  EXPECT_EQ(entries[1]["subject"], "water");
}

json doubt_of(const char* code, json widening) {
  return {
      {"code", code}, {"value", 0.5}, {"widening", std::move(widening)}, {"grave", false}, {"text", "says the client"}};
}

TEST_F(FluidModelsRouteTest, OneRobotIsSentAModelOfItsOwnAndNothingOfItIsKept) {
  const char* of_robot = "/api/v1/robots/r1/model";
  ASSERT_EQ(ask("POST", kFluidOfRobot, {{"fluid", "water"}}).status, 200);
  json body{{"fluid", " Water"}, {"model", printed()}};
  body["model"]["doubts"] = json::array({doubt_of("no_linear_model_over_amplitude", 14.5)});
  body["model"]["confirmed_because"] = "checked against the camera";
  const Answered sent = ask("POST", of_robot, body);
  ASSERT_EQ(sent.status, 200) << sent.body;
  EXPECT_EQ(sent.parsed()["model"]["fluid"], "water");
  EXPECT_EQ(sent.parsed()["model"]["fit_error"], 0.0021);
  EXPECT_EQ(model_of("water"), nullptr);
  const json entry = ask("GET", "/api/v1/audit?action=robot.model_sent").parsed()["entries"][0];
  EXPECT_EQ(entry["robot_id"], "r1");
  EXPECT_EQ(entry["subject"], "water");
  EXPECT_EQ(entry["detail"]["fit_error"], 0.0021);
  EXPECT_EQ(entry["detail"]["confirmed_because"], "checked against the camera");

  EXPECT_EQ(ask("POST", "/api/v1/robots/r9/model", body).status, 404);
  body["fluid"] = "oil";
  const Answered other = ask("POST", of_robot, body);
  EXPECT_EQ(other.status, 409);
  EXPECT_EQ(other.parsed()["reason"], "other_fluid");
  body["model"]["fit_error"] = 0.2;
  EXPECT_EQ(ask("POST", of_robot, body).parsed()["reason"], "fit_too_bad");
  for (const char* missing : {"fluid", "model"}) {
    json less = body;
    less.erase(missing);
    EXPECT_EQ(ask("POST", of_robot, less).status, 400) << missing;
  }
}

// SAFETY's test: whether a doubt is grave, the station says by its number.
TEST_F(FluidModelsRouteTest, OneInGraveDoubtIsAssumedUnlessSomebodySaysWhyNot) {
  json body = printed();
  body["doubts"] = json::array({doubt_of("residuals_not_white", 1.9)});
  ASSERT_EQ(ask("POST", kModel, body).status, 200);
  EXPECT_EQ(model_of("water")["assumed_because"], nullptr);
  EXPECT_EQ(model_of("water")["doubts"][0]["widening"], 1.9);

  for (const json& widening : {json(14.5), json(nullptr)}) {
    body["doubts"] = json::array({doubt_of("no_linear_model_over_amplitude", widening)});
    const Answered set = ask("POST", kModel, body);
    ASSERT_EQ(set.status, 200) << set.body;
    EXPECT_THAT(set.parsed()["model"]["assumed_because"].get<std::string>(), HasSubstr("no linear model holds"));
    EXPECT_EQ(set.parsed()["model"]["doubts"][0]["grave"], true);
  }
  body["doubts"] = nullptr;  // not known: an earlier version has fitted it
  EXPECT_THAT(ask("POST", kModel, body).parsed()["model"]["assumed_because"].get<std::string>(),
              HasSubstr("not known"));
  body["confirmed_because"] = "checked against the camera";
  ASSERT_EQ(ask("POST", kModel, body).status, 200);
  EXPECT_EQ(model_of("water")["assumed_because"], nullptr);
  EXPECT_EQ(model_of("water")["confirmed_because"], "checked against the camera");
  const json entries = ask("GET", "/api/v1/audit?action=fluid").parsed()["entries"];
  EXPECT_EQ(entries[0]["detail"]["confirmed_because"], "checked against the camera") << entries[0];
  EXPECT_TRUE(entries[1]["detail"].contains("assumed_because")) << entries[1];
}

TEST_F(FluidModelsRouteTest, DoubtsThatNobodyCanReadAreRefused) {
  const auto refusal = [this](json doubts) {
    json body = printed();
    body["doubts"] = std::move(doubts);
    const Answered set = ask("POST", kModel, body);
    EXPECT_EQ(set.status, 400) << set.body;
    return set.parsed()["detail"].get<std::string>();
  };
  EXPECT_THAT(refusal("none"), HasSubstr("a list of at most 32"));
  EXPECT_THAT(refusal(json::array({1})), HasSubstr("each has \"code\""));
  EXPECT_THAT(refusal(json::array({doubt_of("bad_mood", 1)})), HasSubstr("the code \"bad_mood\" is not known"));
  EXPECT_THAT(refusal(json::array({doubt_of("residuals_drift", 0.5)})), HasSubstr("it is 1 at least"));
  EXPECT_THAT(refusal(json::array({doubt_of("residuals_drift", "much")})), HasSubstr("each has"));
  EXPECT_THAT(refusal(json(33, doubt_of("residuals_drift", 1))), HasSubstr("a list of at most 32"));
}

TEST_F(FluidModelsRouteTest, WhatIsNoModelOrOfNoFluidIsRefusedAndNothingIsKept) {
  json bad = printed();
  bad["fit_error"] = 0.02;
  const Answered refused = ask("POST", kModel, bad);
  EXPECT_EQ(refused.status, 422);
  EXPECT_EQ(refused.parsed()["reason"], "fit_too_bad");
  const Answered unknown = ask("POST", "/api/v1/fluids/watr/model", printed());
  EXPECT_EQ(unknown.status, 422);
  EXPECT_THAT(unknown.parsed()["detail"].get<std::string>(), HasSubstr("'watr' is none of non_newtonian, oil, water"));
  EXPECT_EQ(ask("POST", "/api/v1/fluids/watr/model/remove", json::object()).status, 422);
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("POST", kModel, printed()).status, 403);
  EXPECT_EQ(model_of("water"), nullptr);
}

TEST_F(FluidModelsRouteTest, NothingIsSentByItselfToARobotInTheFluid) {
  ASSERT_EQ(ask("POST", kFluidOfRobot, {{"fluid", "water"}}).parsed()["model"]["state"], "assumed");
  const Answered set = ask("POST", kModel, printed());
  EXPECT_EQ(set.parsed()["robots_not_updated"], json::array({"r1"}));
  clock.run_for(1s);
  EXPECT_EQ(robot->commands().size(), 0U);
}

TEST_F(FluidModelsRouteTest, TheAnswerAndTheRobotsDocumentSayWhatBecameOfIt) {
  ASSERT_EQ(ask("POST", kModel, printed()).status, 200);
  const auto asked = begin("POST", kFluidOfRobot, {{"fluid", "water"}});
  clock.run_for(200ms);
  ASSERT_EQ(robot->commands().size(), 1U);
  EXPECT_STREQ(robot->commands()[0].action.set_parameter.name, "model_gain_1_m_s");
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["model"]["state"], "sending");
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_REJECTED, 0,
                     rheonaut_REJECT_REASON_UNKNOWN_PARAMETER);
  const json model = end(asked).parsed()["model"];
  EXPECT_EQ(model["state"], "failed");
  EXPECT_EQ(model["fluid"], "water");
  EXPECT_EQ(model["reason"], "model_gain_1_m_s = 0.1: rejected, unknown_parameter");
  EXPECT_EQ(model["fit_error"], 0.0021);
  EXPECT_EQ(ask("GET", "/api/v1/robots/r1").parsed()["model"], model);
}

}  // namespace
}  // namespace server
