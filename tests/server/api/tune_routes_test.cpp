// From a model to a controller on a robot, over the routes: jobs that tune, what they leave to be kept, the push.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "control/tuning/tune.hpp"
#include "server/analysis/tuning/controller_document.hpp"
#include "server/api/bodies/job_body.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

json plant_json() { return json::parse(analysis::json_of(control::kNonNewtonianModel).dump()); }

class TuneRoutesTest : public ApiTest {
 protected:
  static json specification(const json& more = json::object()) {
    json body{{"kind", "tune"}, {"model_id", 1}, {"crossover_rad_s", 3}, {"phase_margin_deg", 90}};
    body.update(more);
    return body;
  }
  void keep_model() {
    const json body{{"kind", "model"}, {"name", "(29)"}, {"document", plant_json()}};
    ASSERT_EQ(ask("POST", "/api/v1/designs", body).status, 201);
  }
  json done(const json& body) {
    const Answered begun = ask("POST", "/api/v1/jobs", body);
    EXPECT_EQ(begun.status, 202) << begun.body;
    if (begun.status != 202) return {};
    const json job =
        ask("GET", fmt::format("/api/v1/jobs/{}?wait_ms=20000", begun.parsed()["job_id"].get<int>())).parsed();
    EXPECT_EQ(job["state"], "done") << job;
    return job["result"];
  }
  std::string refusal(const json& body) { return ask("POST", "/api/v1/jobs", body).parsed()["detail"]; }
};

TEST_F(TuneRoutesTest, ARunThatIsNotThereIsNoneToMeasure) {
  EXPECT_THAT(refusal({{"kind", "tune_measured"}, {"run_id", 7}, {"crossover_rad_s", 4}, {"phase_margin_deg", 95}}),
              HasSubstr("there is no run 7"));
}

TEST_F(TuneRoutesTest, FindsTheControllerOfTheTunerReadyForRobotsAndPredictedInEveryFluid) {
  keep_model();
  const json water{{"model_gain_m_s", {0.1, 0, 0, 0}},
                   {"model_time_constant_s", {0.1, 1, 1, 1}},
                   {"fit_error", 0.001},
                   {"plant", {{"kp", 0.35}, {"b1", 0.0015}, {"b2", 0.09}, {"alpha", 2}, {"beta", 1}}}};
  ASSERT_EQ(ask("POST", "/api/v1/fluids/water/model", water).status, 200);
  json without = water;
  without.erase("plant");
  ASSERT_EQ(ask("POST", "/api/v1/fluids/non_newtonian/model", without).status, 200);
  const json result = done(specification());
  const control::FopdController tuned =
      control::tune(control::kNonNewtonianModel, {3, 90, {}, false}).tuned->controller;
  EXPECT_EQ(result["feasible"], true);
  EXPECT_EQ(result["kp"], tuned.kp);
  EXPECT_EQ(result["kd"], tuned.kd);
  EXPECT_EQ(result["mu"], tuned.mu);
  EXPECT_NEAR(result["achieved"]["phase_margin_deg"], 90, 1e-6);
  EXPECT_EQ(result["plant_source"], (json{{"model_id", 1}}));
  EXPECT_EQ(result["discretised"]["period_s"], 0.01);
  EXPECT_NEAR(result["discretised"]["dc_gain"].get<double>() / tuned.kp, 1, 1e-9);
  EXPECT_FALSE(result["discretised"].contains("duty_min")) << "a robot keeps its range";
  EXPECT_EQ(result["robustness"]["rows"].size(), 8U);
  ASSERT_EQ(result["predicted"].size(), 2U) << "the plant, and the fluid whose plant is known";
  EXPECT_EQ(result["predicted"][0]["fluid"], nullptr);
  EXPECT_NEAR(result["predicted"][0]["step"]["settling_s"], 1.77, 0.1) << "1.77 s is with a = 0.5";
  EXPECT_EQ(result["predicted"][1]["fluid"], "water");
  EXPECT_LT(result["predicted"][1]["step"]["settling_s"], 1.2);
}

TEST_F(TuneRoutesTest, SaysHowUncertainTheMarginIsWhereTheModelIsOfAFit) {
  json fit{{"structure", "fractional"},
           {"parameters", plant_json()},
           {"one_sigma", {{"kp", 0.001}, {"b1", 3e-4}, {"b2", 2e-3}, {"alpha", 0.01}, {"beta", 0.01}}},
           {"correlation", json::array()}};
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    fit["correlation"].push_back({i == 0, i == 1, i == 2, i == 3, i == 4});
    for (json& value : fit["correlation"].back()) value = value.get<bool>() ? 1 : 0;
  }
  const json body{{"kind", "model"}, {"name", "of a fit"}, {"document", fit}};
  ASSERT_EQ(ask("POST", "/api/v1/designs", body).status, 201);
  const json of_design = done(specification())["achieved"];
  EXPECT_GT(of_design["phase_margin_sigma_deg"], 0);
  EXPECT_GT(of_design["crossover_sigma_rad_s"], 0);
  json given = specification({{"plant", fit}});
  given.erase("model_id");
  EXPECT_EQ(done(given)["achieved"]["phase_margin_sigma_deg"], of_design["phase_margin_sigma_deg"]);
  given["plant"] = plant_json();
  EXPECT_EQ(done(given)["achieved"]["phase_margin_sigma_deg"], nullptr);
}

TEST_F(TuneRoutesTest, KeepsTheDutyRangeAndPeriodThatItIsGiven) {
  keep_model();
  const json result = done(specification({{"duty_min", 0}, {"duty_max", 0.8}, {"period_s", 0.02}}));
  EXPECT_EQ(result["discretised"]["method"], "direct");
  EXPECT_EQ(result["discretised"]["a"], 0.0) << "as a motor without reverse needs it";
  EXPECT_EQ(result["discretised"]["duty_min"], 0.0);
  EXPECT_EQ(result["discretised"]["duty_max"], 0.8);
  EXPECT_EQ(result["discretised"]["period_s"], 0.02);
  EXPECT_EQ(result["predicted"][0]["experiment"]["duty_min"], 0.0);
}

TEST_F(TuneRoutesTest, SaysOfAControllerThatItIsNearlyAllDerivative) {
  const auto tuned = [this](double crossover_rad_s, double margin_deg) {
    return done({{"kind", "tune"},
                 {"plant", plant_json()},
                 {"crossover_rad_s", crossover_rad_s},
                 {"phase_margin_deg", margin_deg}});
  };
  EXPECT_EQ(tuned(3, 90)["warnings"], json::array());
  const json result = tuned(0.01, 120);
  ASSERT_EQ(result["warnings"].size(), 1U);
  EXPECT_THAT(result["warnings"][0].get<std::string>(), HasSubstr("nearly all of it is derivative"));
}

// The paper's own specification.
TEST_F(TuneRoutesTest, WhatNothingMeetsIsAResultWithAnOffer) {
  const json result =
      done({{"kind", "tune"}, {"plant", plant_json()}, {"crossover_rad_s", 65}, {"phase_margin_deg", 72}});
  EXPECT_EQ(result["feasible"], false);
  EXPECT_THAT(result["reason"].get<std::string>(), HasSubstr("theta = 107"));
  EXPECT_GE(result["nearest_all"].size() + result["relaxed"].size(), 2U);
  EXPECT_EQ(result["plant_source"], (json{{"given", true}}));
  EXPECT_FALSE(result.contains("discretised"));
  const json body{{"kind", "controller"}, {"name", "none"}, {"job_id", 1}};
  const Answered kept = ask("POST", "/api/v1/designs", body);
  EXPECT_EQ(kept.status, 422);
  EXPECT_THAT(kept.body, HasSubstr("not feasible"));
}

TEST_F(TuneRoutesTest, ItsResultIsKeptAsAControllerOfItsModel) {
  keep_model();
  done(specification());
  const Answered kept = ask("POST", "/api/v1/designs", {{"kind", "controller"}, {"name", "3/90"}, {"job_id", 1}});
  ASSERT_EQ(kept.status, 201) << kept.body;
  EXPECT_EQ(kept.parsed()["model_id"], 1);
  EXPECT_EQ(kept.parsed()["runs"], json::array());
  EXPECT_EQ(kept.parsed()["options"]["crossover_rad_s"], 3);
  const json document = ask("GET", "/api/v1/designs/2/document").parsed();
  const auto sections = analysis::sections_of(document, 0.01, false);
  ASSERT_TRUE(sections) << sections.error().detail;
  EXPECT_EQ(sections->at("sections"), document["discretised"]["sections"]);
  EXPECT_EQ(ask("POST", "/api/v1/designs", {{"kind", "model"}, {"name", "no"}, {"job_id", 1}}).status, 400);
}

TEST_F(TuneRoutesTest, TheMapHasTheMarginsOfEveryCrossover) {
  keep_model();
  const json result =
      done({{"kind", "tuning_map"}, {"model_id", 1}, {"from_rad_s", 3}, {"to_rad_s", 12}, {"points", 3}});
  ASSERT_EQ(result["points"].size(), 3U);
  EXPECT_EQ(result["points"][0]["reason"], "feasible");
  EXPECT_NEAR(result["points"][0]["lowest_phase_margin_deg"], 88.61, 0.01);
  EXPECT_NEAR(result["points"][0]["highest_phase_margin_deg"], 149.16, 0.01);
  EXPECT_EQ(result["points"][2]["reason"], "phase_falls_too_fast");
  EXPECT_EQ(result["points"][2]["lowest_phase_margin_deg"], nullptr);
  EXPECT_EQ(result["plant_source"], (json{{"model_id", 1}}));
}

TEST_F(TuneRoutesTest, RefusesAPlantThatIsNotThere) {
  EXPECT_THAT(refusal(specification()), HasSubstr("there is no design 1"));
  const json fluid{{"kind", "tune"}, {"fluid", "water"}, {"crossover_rad_s", 3}, {"phase_margin_deg", 90}};
  EXPECT_THAT(refusal(fluid), HasSubstr("the fluid 'water' has no model with its plant"));
  const json pd{{"kind", "controller"}, {"name", "PD"}, {"document", {{"kp", 3}, {"kd", 0.1}, {"mu", 0.9}}}};
  ASSERT_EQ(ask("POST", "/api/v1/designs", pd).status, 201);
  EXPECT_THAT(refusal(specification()), HasSubstr("design 1 is a controller; give a model"));
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("POST", "/api/v1/jobs", specification()).status, 403);
}

TEST(ParseTuneJob, SaysWhichMemberIsWrong) {
  struct Case {
    json more;
    const char* words;
  };
  const Case cases[] = {
      {{{"fluid", "water"}}, "give one of model_id, fluid and plant for the plant to tune for; 2 are given"},
      {{{"crossover_rad_s", 0}}, "crossover_rad_s must be from 0.001 to 10000, is 0"},
      {{{"crossover_rad_s", "3"}}, "crossover_rad_s = \"3\" is not a number"},
      {{{"phase_margin_deg", 180}}, "phase_margin_deg must be from 0.1 to 179.9, is 180"},
      {{{"mu", 2}}, "mu must be from 0.01 to 1.99, is 2"},
      {{{"duty_min", 0.1}}, "duty_min must be from -1 to 0, is 0.1"},
      {{{"duty_max", 0}}, "duty_max must be from 0.01 to 1, is 0"},
      {{{"period_s", 2}}, "period_s must be from 0.001 to 1, is 2"},
      {{{"velocity_loop", 1}}, "velocity_loop must be true or false"},
      {{{"points", 3}}, "\"points\" is not known here"},
      {{{"model_id", 0}}, "model_id = 0 is outside"},
  };
  for (const Case& wrong : cases) {
    json body{{"kind", "tune"}, {"model_id", 1}, {"crossover_rad_s", 3}, {"phase_margin_deg", 90}};
    body.update(wrong.more);
    const auto parsed = api::parse_job(body.dump());
    ASSERT_FALSE(parsed) << body;
    EXPECT_THAT(parsed.error().detail, HasSubstr(wrong.words));
  }
  const auto without = api::parse_job(R"({"kind":"tune","model_id":1,"phase_margin_deg":90})");
  EXPECT_THAT(without.error().detail, HasSubstr("crossover_rad_s is missing"));
  const auto map = api::parse_job(R"({"kind":"tuning_map","model_id":1,"from_rad_s":5,"to_rad_s":5})");
  EXPECT_THAT(map.error().detail, HasSubstr("from_rad_s is 5, it must be below to_rad_s, which is 5"));
  const auto plant = api::parse_job(R"({"kind":"tuning_map","plant":{"kp":1}})");
  EXPECT_THAT(plant.error().detail, HasSubstr("key \"b1\" is missing"));
  const auto measured = api::parse_job(R"({"kind":"tune_measured","crossover_rad_s":4,"phase_margin_deg":90})");
  EXPECT_THAT(measured.error().detail, HasSubstr("run_id is missing"));
  const auto points = api::parse_job(R"({"kind":"tuning_map","fluid":"water","points":1})");
  EXPECT_THAT(points.error().detail, HasSubstr("points = 1 is outside"));
}

}  // namespace
}  // namespace server
