// Models and controllers that are kept: what is stored, what is refused, ancestry and comparison.
#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "base/version.hpp"
#include "server/analysis/control_json.hpp"
#include "server/runtime/sha256.hpp"
#include "server/storage/jobs/jobs.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kDesigns = "/api/v1/designs";

json a_model(double kp = 0.1) { return {{"kp", kp}, {"b1", 0.0057}, {"b2", 0.11}, {"alpha", 1.7}, {"beta", 0.87}}; }

// As identify prints it.
json a_fit(double kp, double sigma) {
  const json model = a_model(kp);
  json fit{{"parameters", model}, {"structure", "fractional"}, {"correlation", json::array()}};
  for (const char* name : control::kParameterNames) fit["one_sigma"][name] = sigma;
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    fit["correlation"].push_back(std::vector<double>(control::kParameters, 0));
    fit["correlation"][i][i] = 1;
  }
  return fit;
}

class DesignRoutesTest : public ApiTest {
 protected:
  Answered store(const json& body) { return ask("POST", kDesigns, body); }
  Answered store_model(const std::string& name, const json& document, const json& more = json::object()) {
    json body{{"kind", "model"}, {"name", name}, {"document", document}};
    body.update(more);
    return store(body);
  }
  json get(int id) { return ask("GET", fmt::format("{}/{}", kDesigns, id)).parsed(); }
  void make_run() {
    connect_robot();
    make_samples(*robot, 0, 25);
    ASSERT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}}).status, 201);
  }
};

TEST_F(DesignRoutesTest, IsStoredWithItsOriginAndExportedAsItIs) {
  make_run();
  const Answered made = store_model(
      "softener", a_fit(0.1, 0.001),
      {{"notes", "at 20 °C"}, {"runs", {{{"run_id", 1}, {"span", 0}}}}, {"options", {{"structure", "fractional"}}}});
  ASSERT_EQ(made.status, 201) << made.body;
  const json design = get(1);
  EXPECT_EQ(design["name"], "softener");
  EXPECT_EQ(design["notes"], "at 20 °C");
  EXPECT_EQ(design["runs"], json::parse(R"([{"run_id":1,"span":0}])"));
  EXPECT_EQ(design["options"]["structure"], "fractional");
  EXPECT_EQ(design["made_by"], "token:local");
  EXPECT_EQ(design["made_with"], base::version());
  EXPECT_EQ(design["document"], a_fit(0.1, 0.001));
  const std::string exported = ask("GET", "/api/v1/designs/1/document").body;
  EXPECT_EQ(runtime::sha256_of(exported), design["sha256"].get<std::string>());
  EXPECT_TRUE(analysis::model_from(json::parse(exported)));
  const json audit = ask("GET", "/api/v1/audit?action=design.stored").parsed()["entries"];
  ASSERT_EQ(audit.size(), 1U);
  EXPECT_EQ(audit[0]["subject"], "1");
  EXPECT_EQ(audit[0]["detail"]["sha256"], design["sha256"]);
}

TEST_F(DesignRoutesTest, AChangeIsANewOneWithAParent) {
  ASSERT_EQ(store_model("first", a_model()).status, 201);
  ASSERT_EQ(store_model("second", a_model(0.11), {{"parent_id", 1}}).status, 201);
  ASSERT_EQ(store_model("third", a_model(0.12), {{"parent_id", 2}}).status, 201);
  ASSERT_EQ(store({{"kind", "controller"},
                   {"name", "PD"},
                   {"model_id", 3},
                   {"document", {{"kp", 65}, {"kd", 0.03}, {"mu", 0.65}}}})
                .status,
            201);
  std::vector<std::string> names;
  for (const json& ancestor : get(3)["ancestors"]) names.push_back(ancestor["name"]);
  EXPECT_THAT(names, ElementsAre("second", "first"));
  EXPECT_EQ(get(1)["document"], a_model()) << "a change leaves it as it was";
  EXPECT_THAT(get(4)["ancestors"], IsEmpty());
  EXPECT_EQ(get(4)["model_id"], 3);
  const json models = ask("GET", "/api/v1/designs?kind=model&limit=2").parsed()["designs"];
  ASSERT_EQ(models.size(), 2U);
  EXPECT_EQ(models[0]["design_id"], 3);
  EXPECT_FALSE(models[0].contains("document"));
  EXPECT_EQ(ask("GET", "/api/v1/designs?before=2").parsed()["designs"].size(), 1U);
}

TEST_F(DesignRoutesTest, TheDatabaseItselfRefusesAChange) {
  make_run();
  ASSERT_EQ(store_model("first", a_model(), {{"runs", {{{"run_id", 1}}}}}).status, 201);
  SQLite::Database database{(folder.path() / "station.sqlite").string(), SQLite::OPEN_READWRITE};
  for (const char* change : {"UPDATE design SET name = 'x'", "DELETE FROM design",
                             "UPDATE design_source SET run_id = 2", "DELETE FROM design_source"}) {
    EXPECT_THROW(database.exec(change), SQLite::Exception) << change;
  }
  EXPECT_EQ(get(1)["name"], "first");
}

TEST_F(DesignRoutesTest, ListsThoseFoundFromARun) {
  make_run();
  ASSERT_EQ(store_model("by hand", a_model()).status, 201);
  ASSERT_EQ(store_model("found", a_model(), {{"runs", {{{"run_id", 1}}}}}).status, 201);
  const json found = ask("GET", "/api/v1/designs?run_id=1").parsed()["designs"];
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0]["name"], "found");
  EXPECT_EQ(found[0]["runs"][0]["span"], nullptr);
}

TEST_F(DesignRoutesTest, RefusesWhatTheToolsWouldNotRead) {
  struct Case {
    json body;
    int status;
    const char* words;
  };
  const json pd{{"kp", 65}, {"kd", 0.03}, {"mu", 0.65}};
  const Case cases[] = {
      {{{"kind", "dance"}, {"name", "x"}, {"document", a_model()}}, 422, "allowed are model and controller"},
      {{{"kind", "model"}, {"name", ""}, {"document", a_model()}}, 422, "name has 0 bytes"},
      {{{"kind", "model"}, {"name", "x"}}, 400, "give one of document and job_id"},
      {{{"kind", "model"}, {"name", "x"}, {"document", a_model()}, {"job_id", 1}}, 400, "give one of"},
      {{{"kind", "model"}, {"name", "x"}, {"document", pd}}, 400, "\"kd\""},
      {{{"kind", "model"}, {"name", "x"}, {"document", a_model(0)}}, 422, "kp must be finite and not 0"},
      {{{"kind", "controller"}, {"name", "x"}, {"document", {{"feasible", false}}}}, 422, "not feasible"},
      {{{"kind", "model"}, {"name", "x"}, {"document", a_model()}, {"parent_id", 9}},
       422,
       "parent_id is 9, there is no"},
      {{{"kind", "controller"}, {"name", "x"}, {"document", pd}, {"parent_id", 1}},
       422,
       "which is a model; give a controller"},
      {{{"kind", "model"}, {"name", "x"}, {"document", a_model()}, {"model_id", 1}},
       422,
       "model_id is of a controller"},
      {{{"kind", "model"}, {"name", "x"}, {"document", a_model()}, {"runs", {{{"run_id", 7}}}}},
       422,
       "there is no run 7"},
      {{{"kind", "model"}, {"name", "x"}, {"document", a_model()}, {"runs", {1}}}, 400, "not an object"},
      {{{"kind", "model"}, {"name", "x"}, {"job_id", 5}}, 404, "there is no job 5"},
      {{{"kind", "model"}, {"name", "x"}, {"job_id", 5}, {"runs", json::array()}}, 400, "runs are the job's"},
  };
  ASSERT_EQ(store_model("first", a_model()).status, 201);
  for (const Case& wrong : cases) {
    const Answered refused = store(wrong.body);
    EXPECT_EQ(refused.status, wrong.status) << wrong.body << refused.body;
    EXPECT_THAT(refused.parsed()["detail"].get<std::string>(), HasSubstr(wrong.words)) << wrong.body;
  }
  EXPECT_EQ(ask("GET", "/api/v1/designs").parsed()["designs"].size(), 1U) << "nothing of them is stored";
  EXPECT_EQ(ask("GET", "/api/v1/designs/9").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/designs/x/document").status, 404);
}

TEST_F(DesignRoutesTest, TakesTheResultOfAJob) {
  make_run();
  const std::string result = a_fit(0.1, 0.001).dump();
  bool has_begun = false;
  const auto work = [result](storage::JobRun&) -> boost::asio::awaitable<Result<std::string>> { co_return result; };
  const auto begin = [&]() -> boost::asio::awaitable<void> {
    const storage::JobRequest request{"identify", R"({"kind":"identify","run_id":1,"span":0})", "token:local"};
    has_begun = (co_await recording.jobs.begin(request, work)).has_value();
  };
  tasks.spawn("begin", begin());
  ASSERT_TRUE(clock.run_until([&] { return has_begun; }, 1s));
  ask("GET", "/api/v1/jobs/1?wait_ms=1000");
  const Answered made = store({{"kind", "model"}, {"name", "of a job"}, {"job_id", 1}});
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(ask("GET", "/api/v1/designs/1/document").body, result);
  EXPECT_EQ(get(1)["runs"], json::parse(R"([{"run_id":1,"span":0}])"));
  EXPECT_EQ(get(1)["options"]["kind"], "identify");
  EXPECT_EQ(store({{"kind", "controller"}, {"name", "x"}, {"job_id", 1}}).status, 400) << "its result is a model";
}

TEST_F(DesignRoutesTest, ComparesParametersInUnitsOfTheirUncertainty) {
  ASSERT_EQ(store_model("first", a_fit(0.1, 0.003)).status, 201);
  ASSERT_EQ(store_model("second", a_fit(0.11, 0.004)).status, 201);
  json scaled = a_model(0.2);
  for (const char* name : {"b1", "b2"}) scaled[name] = 2 * scaled[name].get<double>();
  scaled["b3"] = 2;
  ASSERT_EQ(store_model("scaled", scaled).status, 201);
  const json compared = ask("GET", "/api/v1/design-comparison?ids=1,2,3").parsed();
  EXPECT_EQ(compared["designs"][1]["name"], "second");
  const json& kp = compared["parameters"][0];
  EXPECT_EQ(kp["name"], "kp");
  EXPECT_EQ(kp["values"], json({0.1, 0.11, 0.1})) << "divided by b3";
  EXPECT_NEAR(kp["relative_to_first"][1].get<double>(), 0.1, 1e-12);
  EXPECT_NEAR(kp["sigmas_from_first"][1].get<double>(), 2, 1e-9);
  EXPECT_EQ(kp["sigmas_from_first"][2], nullptr) << "it was written by hand";
  EXPECT_EQ(compared["together"][0], nullptr);
  EXPECT_EQ(compared["together"][2], nullptr);
  EXPECT_EQ(ask("GET", "/api/v1/design-comparison").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/design-comparison?ids=1").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/design-comparison?ids=1,9").status, 404);
  ASSERT_EQ(store({{"kind", "controller"}, {"name", "PD"}, {"document", {{"kp", 1}, {"kd", 1}, {"mu", 1}}}}).status,
            201);
  EXPECT_EQ(ask("GET", "/api/v1/design-comparison?ids=1,4").parsed()["reason"], "other_kind");
}

TEST_F(DesignRoutesTest, MarksTheSigmaOfAParameterAtItsBound) {
  json at_bound = a_fit(0.1, 0.003);
  at_bound["parameters"]["alpha"] = 2;
  ASSERT_EQ(store_model("inside", a_fit(0.1, 0.003)).status, 201);
  ASSERT_EQ(store_model("at the bound", at_bound).status, 201);
  ASSERT_EQ(store_model("without a fit", at_bound["parameters"]).status, 201);
  const json compared = ask("GET", "/api/v1/design-comparison?ids=1,2,3").parsed();
  EXPECT_EQ(compared["parameters"][3]["name"], "alpha");
  EXPECT_EQ(compared["parameters"][3]["at_bound"], json({false, true, false}));
  EXPECT_EQ(compared["parameters"][0]["at_bound"], json({false, false, false}));
}

// Where a fit cannot tell kp from b2, they are wrong together: along that line it is the same model, across it another.
TEST_F(DesignRoutesTest, ComparesAllParametersTogetherWithTheirCorrelations) {
  const auto fit = [](double kp, double b2) {
    json made = a_fit(kp, 0.003);
    made["parameters"]["b2"] = b2;
    made["correlation"][0][2] = made["correlation"][2][0] = 0.99;
    return made;
  };
  for (const double b2 : {0.11, 0.116, 0.104}) {
    ASSERT_EQ(store_model("fit", fit(b2 == 0.11 ? 0.1 : 0.106, b2)).status, 201);
  }
  json other_order = a_model();
  other_order["alpha"] = 1.8;
  ASSERT_EQ(store_model("other alpha", other_order).status, 201);
  const json compared = ask("GET", "/api/v1/design-comparison?ids=1,2,3,4").parsed();
  const json &along = compared["together"][1], &across = compared["together"][2];
  EXPECT_NEAR(along["chi_square"].get<double>(), 2 * 2 / 1.99, 1e-6);
  EXPECT_EQ(along["degrees_of_freedom"], 5);
  EXPECT_NEAR(along["p"].get<double>(), 0.848, 1e-3);
  EXPECT_NEAR(across["chi_square"].get<double>(), 2 * 2 / 0.01, 1e-3);
  EXPECT_LT(across["p"].get<double>(), 1e-9);
  EXPECT_EQ(compared["together"][3], nullptr) << "it was written by hand";
  EXPECT_EQ(compared["parameters"][1]["relative_to_first"], json({0.0, 0.0, 0.0, nullptr})) << "b1 is in s^alpha";
  EXPECT_EQ(compared["parameters"][2]["relative_to_first"][3], 0.0) << "b2 is in s^beta, which is the same";
}

}  // namespace
}  // namespace server
