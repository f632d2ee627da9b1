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

TEST_F(ProfileTool, PrintsItsTextWhichIsAProfile) {
  save("mine.toml", ask("profile identification_set --text").text);
  EXPECT_THAT(ask("profile @mine.toml").text, StartsWith("Identification set\n"));
  EXPECT_THAT(ask("profile @mine.toml --csv").text,
              StartsWith("t_s,duty,velocity_m_s,position_m,setpoint_m\n0,0,0,0,"));
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
