// `rheonaut profile`: the list, a table, JSON and CSV, and a prediction that leaves the limits.
#include <gmock/gmock.h>

#include "server/experiments/profile_document.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

class ProfileTool : public ToolTest {};

TEST_F(ProfileTool, WithUntilItShowsWhatEachRunMayBe) {
  const Answer answer = ask("profile orders");
  EXPECT_THAT(answer.text, HasSubstr("Until sigma(alpha) <= 0.02, at most 6 runs. Each performs one of these:"));
  EXPECT_THAT(answer.text, HasSubstr("5       3  chirp           1         30.00"));
  const auto json = ask("profile orders --json").json();
  EXPECT_EQ(json["until"], "sigma(alpha) <= 0.02");
  EXPECT_EQ(json["runs"][4]["step"], 3);
}

TEST_F(ProfileTool, EveryProfileOfTheProgramStaysWithinItsLimits) {
  const auto list = ask("profile --json").json()["profiles"];
  ASSERT_EQ(list.size(), experiments::shipped_profiles().size());
  for (const auto& each : list) {
    const std::string name = each["profile"];
    const Answer answer = ask("profile " + name + " --json");
    EXPECT_EQ(answer.exit_code, 0) << name;
    const auto json = answer.json();
    EXPECT_EQ(json["runs"].size(), each["runs"]) << name;
    for (const auto& run : json["runs"]) EXPECT_THAT(run["problems"], IsEmpty()) << name;
  }
}

TEST_F(ProfileTool, PredictsWhatPredictDoes) {
  const auto step = ask("predict --json").json();
  const auto json = ask("profile figure_7 --json").json();
  EXPECT_EQ(json["t_s"].size(), 4001u);
  for (const std::size_t k : {50u, 200u, 1999u, 2100u, 4000u}) {
    EXPECT_NEAR(json["position_m"][k], step["position_m"][k], 1e-9) << k;
  }
  EXPECT_TRUE(ask("profile figure_5 --json").json()["setpoint_m"][200].is_null());
}

TEST_F(ProfileTool, ARunOfWaterIsPredictedWithItsModel) {
  const auto json = ask("profile figure_8 --json").json();
  EXPECT_NEAR(json["runs"][0]["position_max_m"], 0.1005, 5e-4);
  EXPECT_NEAR(json["runs"][1]["position_max_m"], 0.1098, 5e-4) << "9.8 % overshoot";
  EXPECT_GT(ask("profile figure_8 --run 2 --json").json()["position_m"][80], 0.1);
  EXPECT_THAT(ask("profile figure_8 --run 3").error, HasSubstr("--run 3: the profile has 2 runs"));
}

// The uncertainty of the gain alone: its part of the band is in proportion to the motion.
TEST_F(ProfileTool, AModelThatIdentifyFoundGivesABand) {
  EXPECT_TRUE(ask("profile figure_5 --json").json()["position_sd_m"].is_null()) << "the paper's has no uncertainty";
  save("fit.json",
       R"({"structure": "first_order", "parameters": {"kp": 0.1, "b1": 0, "b2": 0.11, "alpha": 2, "beta": 1},
    "one_sigma": {"kp": 0.01, "b1": null, "b2": 0, "alpha": null, "beta": null},
    "correlation": [[1,0,0,0,0],[0,0,0,0,0],[0,0,1,0,0],[0,0,0,0,0],[0,0,0,0,0]]})");
  const auto json = ask("profile figure_5 --plant @fit.json --json").json();
  const double position_m = json["position_m"].back(), sd_m = json["position_sd_m"].back();
  EXPECT_GT(position_m, 0.1);
  const double parameters_m = json["position_sd_parts_m"]["parameters"].back();
  EXPECT_NEAR(parameters_m, 0.1 * position_m, 1e-9);
  EXPECT_GT(sd_m, parameters_m);
  EXPECT_GE(json["runs"][0]["position_sd_max_m"], sd_m);
  EXPECT_THAT(ask("profile figure_5 --plant @fit.json").text, HasSubstr("± 2 sd (m)"));
  save("odd.json",
       R"({"structure": "first_order", "parameters": {"kp": 0.1, "b1": 0, "b2": 0.11, "alpha": 2, "beta": 1},
    "one_sigma": {"kp": "0.01"}})");
  EXPECT_THAT(ask("profile figure_5 --plant @odd.json").error,
              HasSubstr("the uncertainty is not as identify prints it"));
}

TEST_F(ProfileTool, APlantWhoseFitDoesNotDetermineAParameterHasNoBand) {
  save("fit.json",
       R"({"structure": "first_order", "parameters": {"kp": 0.1, "b1": 0, "b2": 0.11, "alpha": 2, "beta": 1},
    "one_sigma": {"kp": 0.01, "b1": null, "b2": null, "alpha": null, "beta": null},
    "correlation": [[1,0,0,0,0],[0,0,0,0,0],[0,0,1,0,0],[0,0,0,0,0],[0,0,0,0,0]]})");
  EXPECT_TRUE(ask("profile figure_5 --plant @fit.json --json").json()["position_sd_m"].is_null());
}

TEST_F(ProfileTool, AProfileMayBeJson) {
  save("mine.json", R"({"name": "Small step", "purpose": "p", "limits": {"duty_max": 0.3},
    "step": [{"kind": "duty", "duty": 0.3, "for_s": 2}, {"kind": "rest", "for_s": 1}]})");
  EXPECT_THAT(ask("profile @mine.json").text, StartsWith("Small step\n"));
  save("bad.json", R"({"name": "n", "purpose": "p", "step": [{"kind": "duty", "duty": 2, "for_s": 2}]})");
  EXPECT_THAT(ask("profile @bad.json").error, HasSubstr("bad.json: step[0].duty: is 2, allowed is -1 to 1"));
}

TEST_F(ProfileTool, APredictionSaysThatItIsWithoutTheFlow) {
  save("flow.json", R"({"name": "n", "purpose": "p", "conditions": {"pump": "constant", "mean_flow_m_s": 0.04},
    "step": [{"kind": "rest", "for_s": 1}]})");
  EXPECT_THAT(ask("profile @flow.json").text,
              HasSubstr("The prediction is without the flow of the pump (constant, mean 0.04 m/s).\n"));
  EXPECT_EQ(ask("profile @flow.json --json").json()["ignores_flow"], true);
  EXPECT_EQ(ask("profile figure_5 --json").json()["ignores_flow"], false);
}

TEST_F(ProfileTool, PrintsItsTextWhichIsAProfile) {
  save("mine.toml", ask("profile identification_set --text").text);
  EXPECT_THAT(ask("profile @mine.toml").text, StartsWith("Identification set\n"));
  EXPECT_THAT(ask("profile @mine.toml --csv").text,
              StartsWith("t_s,duty,velocity_m_s,position_m,setpoint_m,position_sd_m\n0,0,0,0,"));
  EXPECT_THAT(ask("profile @mine.toml --text").error, HasSubstr("comes with the program"));
}

TEST_F(ProfileTool, APredictionThatLeavesTheLimitsIsSaidWithTheStep) {
  save("far.toml",
       "name = \"far\"\npurpose = \"p\"\nlimits.position_max_m = 0.1\n"
       "[[step]]\nkind = \"duty\"\nduty = 0.3\nfor_s = 5\n");
  const Answer answer = ask("profile @far.toml");
  EXPECT_EQ(answer.exit_code, 3);
  EXPECT_THAT(answer.text, HasSubstr("run 1: the predicted position passes limits.position_max_m (0.1 m) after 3.4"));
  EXPECT_THAT(answer.text, HasSubstr("in step 1 (duty)"));
}

}  // namespace
}  // namespace server::cli
