// Jobs over the routes: a model from a recorded run, tried on another one; what is refused; who may cancel.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>

#include "control/models/modal_plant.hpp"
#include "server/api/bodies/job_body.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class JobRoutesTest : public ApiTest {
 protected:
  JobRoutesTest() { connect_robot(); }

  // A run of a robot whose position is known, under duties of 1 s each; it begins at `from_m`.
  void record(const std::vector<double>& duties, const std::string& fluid = "", double from_m = 0) {
    json body{{"robot_id", "r1"}, {"name", "duties"}};
    if (!fluid.empty()) body["fluid"] = fluid;
    const Answered made = ask("POST", "/api/v1/runs", body);
    ASSERT_EQ(made.status, 201) << made.body;
    control::ModalPlant plant{control::kNonNewtonianModel, 0.01};
    for (const double duty : duties) {
      for (int frames = 0; frames < 4; ++frames) {
        send(plant, duty, from_m);
        clock.run_for(250ms);
      }
    }
    ASSERT_EQ(ask("POST", fmt::format("/api/v1/runs/{}/end", made.parsed()["run_id"].get<int>())).status, 200);
  }
  void send(control::ModalPlant& plant, double duty, double from_m) {
    constexpr pb_size_t kSamples = 25;
    auto frame = TestRobot::samples_frame(next_seq_, kSamples, 1'000'000 + next_seq_ * 10'000, 0);
    next_seq_ += kSamples;
    protocol::Telemetry& telemetry = frame.body.telemetry;
    for (pb_size_t i = 0; i < kSamples; ++i) {
      telemetry.position_m[i] = static_cast<float>(from_m + plant.position_m());
      telemetry.velocity_m_s[i] = static_cast<float>(plant.velocity_m_s());
      telemetry.duty[i] = static_cast<float>(duty);
      plant.step(duty);
    }
    robot->send(frame);
  }
  json ended(int job_id) {
    const json job = ask("GET", fmt::format("/api/v1/jobs/{}?wait_ms=9000", job_id)).parsed();
    EXPECT_NE(job["ended_at_us"], nullptr) << job;
    return job;
  }
  static json identify(const json& more = json::object()) {
    json body{{"kind", "identify"}, {"run_id", 1}, {"structure", "fractional"}, {"time_limit_s", 600}};
    body.update(more);
    return body;
  }

 private:
  std::uint64_t next_seq_ = 0;
};

TEST_F(JobRoutesTest, IdentifiesARunAndTriesTheModelOnAnother) {
  record({0.3, -0.5, 0.6, -0.2});
  record({-0.4, 0.2});
  const Answered begun = ask("POST", "/api/v1/jobs", identify({{"validation_run_id", 2}, {"residuals", true}}));
  ASSERT_EQ(begun.status, 202) << begun.body;
  EXPECT_EQ(begun.parsed()["state"], "waiting");
  EXPECT_EQ(begun.parsed()["request"]["validation_run_id"], 2);
  const json job = ended(1);
  ASSERT_EQ(job["state"], "done") << job;
  const json& result = job["result"];
  EXPECT_NEAR(result["parameters"]["kp"], control::kNonNewtonianModel.kp / control::kNonNewtonianModel.b3, 1e-3);
  EXPECT_NE(result["one_sigma"]["kp"], nullptr);
  EXPECT_EQ(result["run_id"], 1);
  EXPECT_THAT(result["channels"], ElementsAre("position_m"));
  EXPECT_EQ(result["residuals"]["position_m"].size(), 400U);
  EXPECT_EQ(result["validation"]["run_id"], 2);
  EXPECT_GT(result["validation"]["fit_percent"].get<double>(), 99.9);
  EXPECT_EQ(result["model_in_use"], nullptr);
  const json listed = ask("GET", "/api/v1/jobs").parsed()["jobs"];
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_FALSE(listed[0].contains("result"));
}

TEST_F(JobRoutesTest, ASearchThatReachesItsTimeLimitHasNoModel) {
  record({0.3, -0.5, 0.6, -0.2, 0.5, -0.3, 0.2, -0.6, 0.4, -0.1});
  const json body = identify({{"time_limit_s", 0.1}, {"dead_time_s", 1}});  // a search of seconds
  ASSERT_EQ(ask("POST", "/api/v1/jobs", body).status, 202);
  const json job = ended(1);
  EXPECT_EQ(job["state"], "failed") << job;
  EXPECT_EQ(job["result"], nullptr);
  EXPECT_THAT(job["error"].get<std::string>(),
              AllOf(HasSubstr("the search reached its time limit, 0.1 s, so there is no model: raise the limit"),
                    HasSubstr("time_limit_s of a job, at most 600")));
}

TEST_F(JobRoutesTest, IdentifiesSeveralRunsTogetherAndADesignNamesThem) {
  const json plant{{"kp", 0.2}, {"b1", 0.0}, {"b2", 0.5}, {"alpha", 2}, {"beta", 1}};
  const json model{{"model_gain_m_s", {0.1, 0, 0, 0}},
                   {"model_time_constant_s", {0.1, 1, 1, 1}},
                   {"fit_error", 0.001},
                   {"plant", plant}};
  ASSERT_EQ(ask("POST", "/api/v1/fluids/non_newtonian/model", model).status, 200);
  record({0.3, -0.5, 0.6}, "non_newtonian", 0.25);
  record({-0.4, 0.2, 0.5, -0.6}, "", -0.5);
  record({0.5, -0.3});
  const json body{{"kind", "identify"},        {"runs", {{{"run_id", 1}}, {{"run_id", 2}, {"to_s", 2.5}}}},
                  {"structure", "fractional"}, {"time_limit_s", 600},
                  {"residuals", true},         {"validation_run_id", 3}};
  ASSERT_EQ(ask("POST", "/api/v1/jobs", body).status, 202);
  const json job = ended(1);
  ASSERT_EQ(job["state"], "done") << job;
  const json& result = job["result"];
  EXPECT_NEAR(result["parameters"]["kp"], control::kNonNewtonianModel.kp / control::kNonNewtonianModel.b3, 1e-3);
  EXPECT_FALSE(result.contains("run_id"));
  ASSERT_EQ(result["runs"].size(), 2U);
  EXPECT_EQ(result["runs"][0]["run_id"], 1);
  EXPECT_NEAR(result["runs"][0]["offset_m"].get<double>(), 0.25, 1e-3);
  EXPECT_NEAR(result["runs"][1]["offset_m"].get<double>(), -0.5, 1e-3);
  EXPECT_EQ(result["runs"][0]["residuals"]["position_m"].size(), 300U);
  EXPECT_EQ(result["runs"][1]["residuals"]["position_m"].size(), 251U);
  EXPECT_THAT(result["runs"][1]["channels"], ElementsAre("position_m"));
  EXPECT_GT(result["validation"]["fit_percent"].get<double>(), 99.9);
  EXPECT_EQ(result["model_in_use"]["fluid"], "non_newtonian");
  EXPECT_EQ(result["model_in_use"]["runs"][1]["run_id"], 2);
  EXPECT_LT(result["model_in_use"]["runs"][1]["fit_percent"].get<double>(), 90);

  const Answered kept = ask("POST", "/api/v1/designs", {{"kind", "model"}, {"name", "of two"}, {"job_id", 1}});
  ASSERT_EQ(kept.status, 201) << kept.body;
  ASSERT_EQ(kept.parsed()["runs"].size(), 2U);
  EXPECT_EQ(kept.parsed()["runs"][0]["run_id"], 1);
  EXPECT_EQ(kept.parsed()["runs"][1]["run_id"], 2);
  EXPECT_EQ(ask("GET", "/api/v1/designs?run_id=2").parsed()["designs"].size(), 1U);
}

TEST_F(JobRoutesTest, SaysThatRunsOfAJobAreInDifferentFluids) {
  record({0.3, -0.5, 0.6}, "");
  record({0.3, -0.5, 0.6}, "water");
  record({0.3, -0.5, 0.6}, "non_newtonian");
  json body{{"kind", "identify"}, {"runs", {{{"run_id", 1}}, {{"run_id", 2}}}}, {"structure", "first_order"}};
  ASSERT_EQ(ask("POST", "/api/v1/jobs", body).status, 202);
  EXPECT_THAT(ended(1)["result"]["warnings"].dump(), Not(HasSubstr("in the fluid")));
  body["runs"].push_back({{"run_id", 3}});
  ASSERT_EQ(ask("POST", "/api/v1/jobs", body).status, 202);
  EXPECT_THAT(ended(2)["result"]["warnings"].dump(), HasSubstr("run 2 is in the fluid 'water', run 3 in"));
}

TEST_F(JobRoutesTest, ARunOfSeveralThatCannotBeUsedIsNamed) {
  record({0.3, -0.5});
  record({0.0, 0.0});
  const json runs{{{"run_id", 1}}, {{"run_id", 2}}}, more{{{"run_id", 1}}, {{"run_id", 9}}};
  ASSERT_EQ(ask("POST", "/api/v1/jobs", {{"kind", "identify"}, {"runs", runs}}).status, 202);
  EXPECT_THAT(ended(1)["error"].get<std::string>(), AllOf(HasSubstr("run 2: "), HasSubstr("duty is 0 throughout")));
  EXPECT_EQ(ask("POST", "/api/v1/jobs", {{"kind", "identify"}, {"runs", more}}).status, 404);
}

TEST_F(JobRoutesTest, ComparesWithTheModelThatRobotsInTheFluidAreSent) {
  const json model{{"model_gain_m_s", {0.1, 0, 0, 0}},
                   {"model_time_constant_s", {0.1, 1, 1, 1}},
                   {"fit_error", 0.001},
                   {"plant", {{"kp", 0.2}, {"b1", 0.0}, {"b2", 0.5}, {"alpha", 2}, {"beta", 1}}}};
  ASSERT_EQ(ask("POST", "/api/v1/fluids/non_newtonian/model", model).status, 200);
  record({0.3, -0.5, 0.6}, "non_newtonian");
  ASSERT_EQ(ask("POST", "/api/v1/jobs", identify()).status, 202);
  const json result = ended(1)["result"];
  EXPECT_EQ(result["model_in_use"]["fluid"], "non_newtonian");
  EXPECT_EQ(result["model_in_use"]["parameters"]["kp"], 0.2);
  EXPECT_LT(result["model_in_use"]["fit_percent"].get<double>(), result["fit_percent"].get<double>() - 10);
}

TEST_F(JobRoutesTest, AFailedJobSaysWhy) {
  record({0.0, 0.0});
  ASSERT_EQ(ask("POST", "/api/v1/jobs", identify()).status, 202);
  const json job = ended(1);
  EXPECT_EQ(job["state"], "failed");
  EXPECT_THAT(job["error"].get<std::string>(), HasSubstr("duty is 0 throughout"));
  EXPECT_EQ(job["result"], nullptr);
  ASSERT_EQ(ask("POST", "/api/v1/jobs", identify({{"from_s", 5}})).status, 202);
  EXPECT_THAT(ended(2)["error"].get<std::string>(), HasSubstr("run 1: span 0 has 0 samples"));
}

TEST_F(JobRoutesTest, RefusesWhatItCannotBegin) {
  EXPECT_EQ(ask("POST", "/api/v1/jobs", identify()).status, 404) << "there is no such run";
  EXPECT_EQ(ask("GET", "/api/v1/jobs/1").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/jobs/none").status, 404);
  EXPECT_EQ(ask("POST", "/api/v1/jobs/1/cancel").status, 404);
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("POST", "/api/v1/jobs", identify()).status, 403);
}

TEST_F(JobRoutesTest, IsCancelledByItsOwnerOrAnAdmin) {
  auto wait = [](storage::JobRun&) -> boost::asio::awaitable<Result<std::string>> { co_return std::string{"1"}; };
  bool has_begun = false;
  const auto begin = [&]() -> boost::asio::awaitable<void> {
    const storage::JobRequest request{"identify", "{}", "user:anna"};
    has_begun = (co_await recording.jobs.begin(request, wait)).has_value();
  };
  tasks.spawn("begin", begin());
  ASSERT_TRUE(clock.run_until([&] { return has_begun; }, 1s));
  scopes = identity::Scopes::of(identity::Role::operator_);
  EXPECT_EQ(ask("POST", "/api/v1/jobs/1/cancel").status, 403);
  scopes = identity::Scopes::of(identity::Role::admin);
  const Answered ended_already = ask("POST", "/api/v1/jobs/1/cancel");
  EXPECT_EQ(ended_already.status, 409);
  EXPECT_EQ(ended_already.parsed()["reason"], "has_ended");
}

TEST(ParseJob, SaysWhichMemberIsWrong) {
  struct Case {
    json more;
    const char* words;
  };
  const Case cases[] = {
      {{{"kind", "dance"}},
       "kind is 'dance', allowed are identify, tune, tuning_map, tune_measured, report, comparison, export"},
      {{{"run_id", 0}}, "run_id = 0 is outside"},
      {{{"run", 1}}, "\"run\" is not known here"},
      {{{"channels", "all"}}, "channels is 'all', allowed are best, outside, robot"},
      {{{"structure", "third_order"}}, "allowed are first_order, second_order, fractional"},
      {{{"cost", 1}}, "cost = 1 is not a string"},
      {{{"from_s", 5}, {"to_s", 5}}, "from_s is 5, it must be below to_s, which is 5"},
      {{{"from_s", -1}}, "from_s must be from 0 to"},
      {{{"time_limit_s", 0}}, "time_limit_s must be from 0.1 to 600, is 0"},
      {{{"residuals", "yes"}}, "residuals must be true or false"},
      {{{"fits_offset", 1}}, "fits_offset must be true or false"},
      {{{"validation_from_s", 1}}, "validation_from_s needs validation_run_id"},
      {{{"runs", {{{"run_id", 1}}}}}, "run_id stands beside runs"},
  };
  for (const Case& wrong : cases) {
    json body{{"kind", "identify"}, {"run_id", 1}};
    body.update(wrong.more);
    const auto parsed = api::parse_job(body.dump());
    ASSERT_FALSE(parsed) << body;
    EXPECT_THAT(parsed.error().detail, HasSubstr(wrong.words));
  }
  EXPECT_THAT(api::parse_job(R"({"kind":"identify"})").error().detail, HasSubstr("run_id is missing"));
  const auto parsed = api::parse_job(R"({"kind":"identify","run_id":7,"to_s":3,"sensor_lag_s":0.01,"span":2})");
  ASSERT_TRUE(parsed) << parsed.error().detail;
  const auto& request = std::get<analysis::IdentifyRequest>(parsed->request);
  ASSERT_EQ(request.runs.size(), 1U);
  EXPECT_EQ(request.runs[0].run, 7);
  EXPECT_EQ(request.runs[0].window.to_s, 3);
  EXPECT_EQ(request.runs[0].window.span, 2U);
  EXPECT_EQ(request.search.sensor_lag_s, 0.01);
  EXPECT_FALSE(request.search.structure);
}

TEST(ParseJob, SaysWhatIsWrongWithSeveralRuns) {
  struct Case {
    const char* runs;
    const char* words;
  };
  const Case cases[] = {
      {"[]", "runs must be a list of 1 to 8 objects"},
      {R"({"run_id":1})", "runs must be a list of 1 to 8 objects"},
      {"[1]", "runs[0] is not an object"},
      {R"([{"run_id":1},{}])", "runs[1]: run_id is missing"},
      {R"([{"run_id":1,"channels":"best"}])", "runs[0]: \"channels\" is not known here"},
      {R"([{"run_id":1,"from_s":3,"to_s":2}])", "runs[0]: from_s is 3, it must be below to_s, which is 2"},
      {R"([{"run_id":1,"span":-1}])", "runs[0]: span = -1 is outside"},
  };
  for (const Case& wrong : cases) {
    const auto parsed = api::parse_job(fmt::format(R"({{"kind":"identify","runs":{}}})", wrong.runs));
    ASSERT_FALSE(parsed) << wrong.runs;
    EXPECT_THAT(parsed.error().detail, HasSubstr(wrong.words));
  }
  const auto parsed = api::parse_job(
      R"({"kind":"identify","with_velocity":true,"runs":[{"run_id":7,"to_s":3},{"run_id":7,"from_s":5,"span":1}]})");
  ASSERT_TRUE(parsed) << parsed.error().detail;
  ASSERT_EQ(std::get<analysis::IdentifyRequest>(parsed->request).runs.size(), 2U);
  EXPECT_EQ(std::get<analysis::IdentifyRequest>(parsed->request).runs[1].window.from_s, 5);
  EXPECT_EQ(std::get<analysis::IdentifyRequest>(parsed->request).runs[1].window.span, 1U);
  EXPECT_TRUE(std::get<analysis::IdentifyRequest>(parsed->request).runs[0].window.with_velocity);
}

}  // namespace
}  // namespace server
