// Fluids over HTTP: their list, which one a robot is in, and runs that name one.
#include <gmock/gmock.h>

#include <functional>
#include <semaphore>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kFluid = "/api/v1/robots/r1/fluid";

class FluidsTest : public ApiTest {
 protected:
  FluidsTest() : ApiTest{config::parse_config("[limits.Water]\nduty_max = 0.5\n[fluids.oil]\n", "test.toml")} {
    connect_robot();
  }
  // What the station says to a duty of 0.8, which water's limits refuse; "" when it is sent.
  std::string refusal_of_high_duty() {
    const std::size_t before = robot->commands().size();
    const auto asked = begin("POST", "/api/v1/robots/r1/commands", {{"kind", "set_duty"}, {"duty", 0.8}});
    if (robot->commands().size() == before) return end(asked).parsed()["detail"];
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
    EXPECT_EQ(end(asked).status, 200);
    return "";
  }
  Answered begin_run(const json& fluid) {
    return ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}, {"fluid", fluid}});
  }
  json robot_fluid() { return ask("GET", "/api/v1/robots/r1").parsed()["fluid"]; }
  void end_run(const Answered& run) {
    const std::string path = "/api/v1/runs/" + run.parsed()["run_id"].dump() + "/end";
    ASSERT_EQ(ask("POST", path, json::object()).status, 200);
  }
};

TEST_F(FluidsTest, AreListedWithTheLimitsOfEach) {
  const json list = ask("GET", "/api/v1/fluids").parsed();
  std::vector<std::string> fluids;
  for (const json& fluid : list["fluids"]) fluids.push_back(fluid["fluid"]);
  EXPECT_THAT(fluids, ElementsAre("non_newtonian", "oil", "water"));
  EXPECT_EQ(list["fluids"][0]["built_in"], true);
  EXPECT_EQ(list["fluids"][1]["built_in"], false);
  EXPECT_EQ(list["fluids"][2]["limits"]["duty_max"], 0.5);
  EXPECT_EQ(list["limits"]["duty_max"], 1);
  EXPECT_EQ(list["limits_where_unknown"]["duty_max"], 0.5);
}

TEST_F(FluidsTest, TheLimitsOfTheRobotsFluidHoldWithoutARun) {
  EXPECT_EQ(robot_fluid(), nullptr);
  EXPECT_THAT(refusal_of_high_duty(), HasSubstr("fluid is not known, so the strictest limits"));
  const Answered set = ask("POST", kFluid, {{"fluid", " OIL "}});
  EXPECT_EQ(set.status, 200) << set.body;
  EXPECT_EQ(set.parsed()["fluid"], "oil");
  EXPECT_EQ(set.parsed()["limits"]["duty_max"], 1);
  EXPECT_EQ(robot_fluid(), "oil");
  EXPECT_EQ(refusal_of_high_duty(), "");
  ASSERT_EQ(ask("POST", kFluid, {{"fluid", "water"}}).status, 200);
  EXPECT_THAT(refusal_of_high_duty(), HasSubstr("limits of the fluid 'water'"));
  EXPECT_EQ(ask("POST", kFluid, {{"fluid", nullptr}}).parsed()["limits"]["duty_max"], 0.5);
  EXPECT_EQ(robot_fluid(), nullptr);
}

TEST_F(FluidsTest, OneThatIsNotListedIsRefusedWithTheList) {
  for (const Answered& refused : {ask("POST", kFluid, {{"fluid", "watr"}}), begin_run("watr")}) {
    EXPECT_EQ(refused.status, 422);
    EXPECT_EQ(refused.parsed()["reason"], "unknown_fluid");
    EXPECT_THAT(refused.parsed()["detail"].get<std::string>(),
                HasSubstr("'watr' is none of non_newtonian, oil, water"));
  }
  EXPECT_EQ(ask("POST", kFluid, json::object()).status, 400);
  EXPECT_EQ(ask("POST", kFluid, {{"fluid", 1}}).status, 400);
  EXPECT_EQ(ask("POST", "/api/v1/robots/r9/fluid", {{"fluid", "oil"}}).status, 404);
  EXPECT_EQ(robot_fluid(), nullptr);
}

TEST_F(FluidsTest, ARunThatNamesAnotherNeedsTheRightToCommand) {
  ASSERT_EQ(ask("POST", kFluid, {{"fluid", "water"}}).status, 200);
  scopes = identity::Scopes{}.add(identity::Scope::record);
  const Answered refused = begin_run("oil");
  EXPECT_EQ(refused.status, 403) << refused.body;
  EXPECT_EQ(refused.parsed()["reason"], "not_permitted");
  EXPECT_EQ(robot_fluid(), "water");
  const json model{{"model_gain_m_s", {0.1, 0, 0, 0}},
                   {"model_time_constant_s", {0.1, 1, 1, 1}},
                   {"fit_error", 0.001},
                   {"plant", {{"kp", 0.1}}}};
  scopes = identity::Scopes::of(identity::Role::operator_);
  ASSERT_LT(ask("POST", "/api/v1/fluids/water/model", model).status, 300);
  scopes = identity::Scopes{}.add(identity::Scope::record);
  const std::size_t commands = robot->commands().size();
  const Answered run = begin_run(" Water");
  ASSERT_EQ(run.status, 201) << run.body;
  EXPECT_EQ(run.parsed()["fluid"], "water");
  clock.run_for(2s);
  EXPECT_EQ(robot->commands().size(), commands) << "nor does it send the robot anything";
  const std::string path = "/api/v1/runs/" + run.parsed()["run_id"].dump();
  EXPECT_EQ(ask("POST", path + "/annotate", {{"fluid", "oil"}}).status, 403);
  EXPECT_EQ(robot_fluid(), "water");
  end_run(run);
  EXPECT_EQ(ask("POST", path + "/annotate", {{"fluid", "oil"}}).status, 200) << "it has ended: no limit hangs on it";
  EXPECT_EQ(robot_fluid(), "water");
}

TEST_F(FluidsTest, AnOpenRunIsPutRightByWhoMayNotCommandWithNothingSaidOfTheRobot) {
  const Answered run = begin_run("water");
  ASSERT_EQ(run.status, 201) << run.body;
  ASSERT_EQ(ask("POST", kFluid, {{"fluid", "oil"}}).status, 200);
  const json model{{"model_gain_m_s", {0.1, 0, 0, 0}},
                   {"model_time_constant_s", {0.1, 1, 1, 1}},
                   {"fit_error", 0.001},
                   {"plant", {{"kp", 0.1}}}};
  ASSERT_LT(ask("POST", "/api/v1/fluids/oil/model", model).status, 300);
  scopes = identity::Scopes{}.add(identity::Scope::record);
  const std::size_t commands = robot->commands().size();
  const std::string path = "/api/v1/runs/" + run.parsed()["run_id"].dump();
  const Answered annotated = ask("POST", path + "/annotate", {{"fluid", " Oil"}});
  EXPECT_EQ(annotated.status, 200) << annotated.body;
  EXPECT_EQ(annotated.parsed()["fluid"], "oil");
  EXPECT_EQ(ask("GET", path).parsed()["fluid"], "oil");
  clock.run_for(2s);
  EXPECT_EQ(robot->commands().size(), commands) << "the robot is sent no model";
}

// SAFETY: a fluid brings its limits.
TEST_F(FluidsTest, WhoseCredentialEndsWhileTheRunIsReadNamesNoFluid) {
  const Answered run = begin_run("water");
  std::binary_semaphore has_ended{0};
  const auto reading = [](runtime::WorkerThread& worker, std::binary_semaphore& until) -> boost::asio::awaitable<void> {
    auto job = [&until] {
      until.acquire();
      return true;
    };
    co_await worker.run(std::move(job));
  };
  tasks.spawn("the database is busy", reading(readers, has_ended));
  const std::string path = "/api/v1/runs/" + run.parsed()["run_id"].dump() + "/annotate";
  std::function<void(int)> end_after = [&](int turns) {  // of the loop: the request has begun to wait by then
    if (turns > 0) return boost::asio::post(loop, [&end_after, turns] { end_after(turns - 1); });
    standing->end();
    has_ended.release();
  };
  end_after(100);
  const auto annotated = begin("POST", path, {{"fluid", "oil"}});
  EXPECT_EQ(end(annotated).status, 403);
  EXPECT_EQ(robot_fluid(), "water");
}

TEST_F(FluidsTest, ARunThatNamesOneSaysItOfTheRobotAndTheEndOfTheRunChangesNothing) {
  const Answered run = begin_run("Oil");
  ASSERT_EQ(run.status, 201) << run.body;
  EXPECT_EQ(run.parsed()["fluid"], "oil");
  EXPECT_EQ(robot_fluid(), "oil");
  end_run(run);
  EXPECT_EQ(robot_fluid(), "oil");
  EXPECT_EQ(refusal_of_high_duty(), "");
  const Answered next = begin_run("");
  EXPECT_EQ(next.parsed()["fluid"], "oil") << "the one that its robot is in";
  const std::string path = "/api/v1/runs/" + next.parsed()["run_id"].dump() + "/annotate";
  EXPECT_EQ(ask("POST", path, {{"fluid", "watr"}}).status, 422);
  EXPECT_EQ(ask("POST", path, {{"fluid", "Water"}}).parsed()["fluid"], "water");
  EXPECT_EQ(robot_fluid(), "water") << "the run is open";
  end_run(next);
  EXPECT_EQ(ask("POST", path, {{"fluid", "oil"}}).status, 200);
  EXPECT_EQ(robot_fluid(), "water") << "the run has ended";
}

TEST_F(FluidsTest, WhileAnotherIsInControlARunNamesNoOtherFluid) {
  ASSERT_EQ(ask("POST", kFluid, {{"fluid", "water"}}).status, 200);
  ASSERT_TRUE(station.control({"r1", "session:1", "", station::ControlAction::take, 60s, ""}));
  const Answered refused = begin_run("oil");
  EXPECT_EQ(refused.status, 409);
  EXPECT_EQ(refused.parsed()["reason"], "not_in_control");
  EXPECT_EQ(ask("POST", kFluid, {{"fluid", nullptr}}).status, 409);
  EXPECT_EQ(robot_fluid(), "water");
  EXPECT_EQ(begin_run("water").status, 201);
  const json entries = ask("GET", "/api/v1/audit?robot_id=r1&action=robot").parsed()["entries"];
  EXPECT_EQ(entries[0]["action"], "robot.fluid_set");
  EXPECT_EQ(entries[0]["subject"], "water");
  EXPECT_EQ(ask("GET", "/api/v1/audit?robot_id=r1&action=fluid").parsed()["entries"].size(), 2U) << "refusals";
}

TEST_F(FluidsTest, ARunMadeAfterwardsNamesAListedOneAndChangesNothing) {
  make_samples(*robot, 0, 10);
  clock.run_for(2s);
  json body{{"robot_id", "r1"}, {"name", "later"}, {"fluid", "watr"}};
  body["span"] = {{"boot_id", "77"}, {"first_seq", 0}, {"last_seq", 9}};
  EXPECT_EQ(ask("POST", "/api/v1/runs", body).status, 422);
  body["fluid"] = "Water";
  EXPECT_EQ(ask("POST", "/api/v1/runs", body).parsed()["fluid"], "water");
  EXPECT_EQ(robot_fluid(), nullptr);
}

}  // namespace
}  // namespace server
