// The fixed forms of model, bode, step and tune, with the numbers of the paper's plant and controller.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class LoopTools : public ToolTest {};

// What identify prints, with doubts of these widenings.
std::string fit_with(const std::string& doubts) {
  return R"({"structure": "fractional", "parameters": {"kp": 0.1, "b1": 0.005682, "b2": 0.11031, "b3": 1, "alpha": 1.7263,
             "beta": 0.8682}, "one_sigma": {"kp": 0.001, "b1": 0.0002, "b2": 0.002, "alpha": 0.01, "beta": 0.01},
             "correlation": [[1,0,0,0,0],[0,1,0,0,0],[0,0,1,0,0],[0,0,0,1,0],[0,0,0,0,1]])" +
         doubts + "}";
}

TEST_F(LoopTools, AMarginIsAsUncertainAsTheDoubtsOfItsModelMakeIt) {
  const auto sigma = [this](const std::string& doubts) {
    save("fit.json", fit_with(doubts));
    return ask("tune --plant @fit.json --crossover-rad-s 5 --phase-margin-deg 91 --json").json();
  };
  const auto sure = sigma(R"(, "doubts": [])");
  const auto wide = sigma(R"(, "doubts": [{"code": "residuals_not_white", "value": 3, "widening": 3}])");
  const double narrow_deg = sure["achieved"]["phase_margin_sigma_deg"],
               wide_deg = wide["achieved"]["phase_margin_sigma_deg"];
  EXPECT_GT(narrow_deg, 0);
  EXPECT_NEAR(wide_deg, 3 * narrow_deg, 1e-9);
  EXPECT_EQ(sure["plant_doubts_text"], "");
  EXPECT_THAT(wide["plant_doubts_text"].get<std::string>(),
              HasSubstr("each ± of what is computed from it is widened 3 times"));
  EXPECT_EQ(wide["plant_doubts"][0]["grave"], true);
  const auto late = sigma(R"(, "doubts": [{"code": "dead_time_not_determined", "value": 0.005, "widening": 1}])");
  const double of_dead_time_deg = 5 * 0.005 * 180 / std::numbers::pi;
  EXPECT_NEAR(late["achieved"]["phase_margin_sigma_deg"], std::hypot(narrow_deg, of_dead_time_deg), 1e-9);
  EXPECT_EQ(late["achieved"]["crossover_sigma_rad_s"], sure["achieved"]["crossover_sigma_rad_s"]);
  EXPECT_THAT(late["plant_doubts_text"].get<std::string>(), HasSubstr("one sigma of it is 5 ms"));
  const auto unknown = sigma(R"(, "doubts": [{"code": "search_not_converged", "value": 2, "widening": null}])");
  EXPECT_EQ(unknown["achieved"]["phase_margin_sigma_deg"], nullptr);
  EXPECT_THAT(unknown["plant_doubts_text"].get<std::string>(), HasSubstr("no ± can be given"));
  const auto old = sigma("");
  EXPECT_EQ(old["plant_doubts"], nullptr);
  EXPECT_THAT(old["plant_doubts_text"].get<std::string>(), HasSubstr("an earlier version has made this fit"));
  EXPECT_NEAR(old["achieved"]["phase_margin_sigma_deg"].get<double>(), narrow_deg, 1e-12);
}

TEST_F(LoopTools, BodeStatesTheSameUncertaintyOfALoopAsTuneDoes) {
  const std::string late = R"(, "doubts": [{"code": "dead_time_not_determined", "value": 0.005, "widening": 1}])";
  save("fit.json", fit_with(late));
  const auto tuned = ask("tune --plant @fit.json --crossover-rad-s 5 --phase-margin-deg 91 --json");
  save("controller.json", tuned.text);
  const std::string bode = "bode --plant @fit.json --controller @controller.json";
  const auto json = ask(bode + " --json").json();
  for (const char* sigma : {"phase_margin_sigma_deg", "crossover_sigma_rad_s", "phase_slope_sigma_deg_per_rad_s"}) {
    const double of_tune = tuned.json()["achieved"][sigma];
    EXPECT_GT(of_tune, 0);
    EXPECT_NEAR(json[sigma].get<double>(), of_tune, 1e-6 * of_tune) << sigma;
  }
  EXPECT_THAT(json["plant_doubts_text"].get<std::string>(), HasSubstr("one sigma of it is 5 ms"));
  EXPECT_THAT(ask(bode).text, HasSubstr("by the sigmas of the plant's fit (± 2 sd): phase margin ± "));
  EXPECT_EQ(ask("bode --json").json()["phase_margin_sigma_deg"], nullptr) << "the paper's";
  EXPECT_THAT(ask("bode").text, Not(HasSubstr("sigmas")));
  save("bare.json", R"({"kp":0.1,"b1":0.01,"b2":0.1,"alpha":1.7,"beta":0.9})");
  EXPECT_THAT(ask("bode --plant @bare.json").text, HasSubstr("the sigmas of the plant's parameters are not known"));
}

TEST_F(LoopTools, AModelInGraveDoubtIsForTheRobotToAssume) {
  save("fit.json",
       fit_with(R"(, "doubts": [{"code": "no_linear_model_over_amplitude", "value": 0.5, "widening": 14}])"));
  const Answer said = ask("estimator --plant @fit.json");
  EXPECT_EQ(said.exit_code, 0) << said.error;
  EXPECT_THAT(said.text, HasSubstr("as assumed only, with model_confirmed = 0, since it is in doubt: no linear model"));
  const auto json = ask("estimator --plant @fit.json --json").json();
  EXPECT_EQ(json["doubts"][0]["code"], "no_linear_model_over_amplitude");
  EXPECT_EQ(json["widening"], 14);
  save("fit.json", fit_with(R"(, "doubts": [])"));
  EXPECT_THAT(ask("estimator --plant @fit.json").text, HasSubstr("with model_confirmed = 1 in this fluid only"));
  save("fit.json", fit_with(""));
  EXPECT_THAT(ask("estimator --plant @fit.json").text,
              HasSubstr("as assumed only, with model_confirmed = 0, since it is "
                        "in doubt: an earlier version has made this fit"));
  const auto of_earlier = ask("estimator --plant @fit.json --json").json();
  EXPECT_TRUE(of_earlier.contains("doubts"));
  EXPECT_EQ(of_earlier["doubts"], nullptr);
  EXPECT_FALSE(ask("estimator --plant non_newtonian --json").json().contains("doubts")) << "nobody fitted it";
}

TEST_F(LoopTools, BodeGivesTheMarginsOfThePapersLoop) {
  const Answer answer = ask("bode --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  const auto json = answer.json();
  EXPECT_NEAR(json["gain_crossover_rad_s"], 5.9995012056, 1e-9);
  EXPECT_NEAR(json["phase_margin_deg"], 64.99778607, 1e-7);
  EXPECT_NEAR(json["phase_slope_deg_per_rad_s"], -3.8399899, 1e-6);
  EXPECT_NEAR(json["ms"], 1.3350, 5e-5);
  EXPECT_NEAR(json["mt"], 1.0008, 5e-5);
  EXPECT_TRUE(json["gain_crossovers_rad_s"].is_array());
  EXPECT_TRUE(json.contains("gain_margin_db"));
  EXPECT_FALSE(json.contains("response"));
}

TEST_F(LoopTools, BodeOfTheVelocityLoopAndOfWater) {
  EXPECT_NEAR(ask("bode --velocity-loop --json").json()["gain_crossover_rad_s"], 62.921, 1e-3);
  const auto water = ask("bode --plant newtonian --json").json();
  EXPECT_NEAR(water["gain_crossover_rad_s"], 15.98298126, 1e-8);
  EXPECT_NEAR(water["phase_margin_deg"], 31.435452, 1e-6);
}

TEST_F(LoopTools, BodePrintsATableOrTheResponseInCsv) {
  const Answer table = ask("bode");
  EXPECT_THAT(table.text, HasSubstr("gain crossover"));
  EXPECT_THAT(table.text, HasSubstr("5.9995012"));
  EXPECT_THAT(table.text, HasSubstr("omega (rad/s)"));
  const Answer csv = ask("bode --csv --from-rad-s 65 --to-rad-s 66 --points 2");
  EXPECT_THAT(csv.text, ::testing::StartsWith("omega_rad_s,magnitude_db,phase_deg\n65,-36.65"));
  EXPECT_EQ(std::ranges::count(csv.text, '\n'), 3);
  EXPECT_EQ(ask("bode --json --points 7").json()["response"]["phase_deg"].size(), 7u);
}

TEST_F(LoopTools, StepGivesTheReferenceValues) {
  const auto json = ask("step --duty 0.3 --times 0.1,1,5,60 --json").json();
  EXPECT_EQ(json["t_s"], (std::vector<double>{0.1, 1, 5, 60}));
  EXPECT_NEAR(json["velocity_m_s"][0], 0.0191855562727, 1e-12);
  EXPECT_NEAR(json["velocity_m_s"][1], 0.0294947721762, 1e-12);
  EXPECT_NEAR(json["velocity_m_s"][2], 0.0298827143987, 1e-12);
  EXPECT_NEAR(json["position_m"][1], 0.0265317661481, 1e-12);
  EXPECT_NEAR(json["position_m"][3], 1.79395895164, 1e-10);
}

TEST_F(LoopTools, StepTakesEquallySpacedTimesAndAnyDuty) {
  const Answer csv = ask("step --every-s 0.5 --until-s 1 --csv");
  EXPECT_THAT(csv.text, ::testing::StartsWith("t_s,duty,velocity_m_s,position_m\n0,0.3,0,0\n0.5,0.3,0.0"));
  EXPECT_EQ(std::ranges::count(csv.text, '\n'), 4);
  save("duty.csv", "# a step, late\nduty; t_s\r\n0;0\r\n0.3;1\r\n0.3;2\r\n");
  const auto json = ask("step --duty-csv @duty.csv --json").json();
  EXPECT_NEAR(json["velocity_m_s"][1], 0, 1e-15);
  EXPECT_NEAR(json["position_m"][2], 0.0265317661481, 1e-9);
  EXPECT_THAT(ask("step").text, HasSubstr("velocity (m/s)"));
}

constexpr const char* kPromptPlant = R"("kp":0.1504,"b1":0.00898,"b2":0.11031,"b3":1,"alpha":1.7263,"beta":0.8682)";

std::string late_model() { return fmt::format(R"({{{},"dead_time_s":0.07}})", kPromptPlant); }

// A model file, what identify prints, and what it printed before parameters held the dead time.
TEST_F(LoopTools, TheDeadTimeOfAPlantFileCountsWhereverItStands) {
  save("prompt.json", fmt::format("{{{}}}", kPromptPlant));
  EXPECT_NEAR(ask("bode --plant @prompt.json --json").json()["phase_margin_deg"], 48.2, 0.05);
  for (const std::string& text : {late_model(), fmt::format(R"({{"parameters":{},"dead_time_s":0.07}})", late_model()),
                                  fmt::format(R"({{"parameters":{{{}}},"dead_time_s":0.07,"sse":1}})", kPromptPlant)}) {
    save("late.json", text);
    const auto json = ask("bode --plant @late.json --json").json();
    EXPECT_NEAR(json["phase_margin_deg"], 12.8, 0.05) << text;
    EXPECT_EQ(json["plant"]["dead_time_s"], 0.07) << text;
  }
}

TEST_F(LoopTools, TwoDeadTimesInOneFileAreRefused) {
  save("late.json", fmt::format(R"({{"parameters":{},"dead_time_s":0.03}})", late_model()));
  EXPECT_THAT(ask("bode --plant @late.json").error, HasSubstr("0.07 in \"parameters\" and 0.03 beside"));
  save("late.json", fmt::format(R"({{{},"dead_time_s":-1}})", kPromptPlant));
  EXPECT_THAT(ask("bode --plant @late.json").error, HasSubstr("dead_time_s must be 0 or positive, is -1"));
}

TEST_F(LoopTools, EveryToolTakesTheDeadTimeOfThePlant) {
  save("prompt.json", fmt::format("{{{}}}", kPromptPlant));
  save("late.json", late_model());
  const auto prompt_step = ask("step --plant @prompt.json --times 0.1,1 --json").json();
  const auto late_step = ask("step --plant @late.json --times 0.07,0.17,1.07 --json").json();
  EXPECT_EQ(late_step["position_m"][0], 0);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(late_step["position_m"][i + 1].get<double>(), prompt_step["position_m"][i].get<double>(), 1e-12);
  }
  const auto late_tune =
      ask("tune --plant @late.json --crossover-rad-s 2 --phase-margin-deg 75 --mu 0.9 --json").json();
  const auto prompt_tune =
      ask("tune --plant @prompt.json --crossover-rad-s 2 --phase-margin-deg 75 --mu 0.9 --json").json();
  EXPECT_NEAR(late_tune["theta_deg"].get<double>() - prompt_tune["theta_deg"].get<double>(), 2 * 0.07 * 180 / M_PI,
              1e-9);
  EXPECT_GT(ask("predict --plant @late.json --json").json()["step"]["overshoot_percent"].get<double>(),
            8 + ask("predict --plant @prompt.json --json").json()["step"]["overshoot_percent"].get<double>());
}

TEST_F(LoopTools, TuneMeetsWhatIsAsked) {
  const auto json = ask("tune --crossover-rad-s 5 --phase-margin-deg 91 --json").json();
  EXPECT_EQ(json["feasible"], true);
  EXPECT_NEAR(json["kp"], 49.413, 1e-3);
  EXPECT_NEAR(json["kd"], 0.10214, 1e-5);
  EXPECT_NEAR(json["mu"], 0.98463, 1e-5);
  EXPECT_NEAR(json["achieved"]["gain_crossover_rad_s"], 5, 1e-8);
  EXPECT_NEAR(json["achieved"]["phase_margin_deg"], 91, 1e-7);
  EXPECT_NEAR(json["achieved"]["phase_slope_deg_per_rad_s"], 0, 1e-7);
}

std::string fit_file(const char* sigma_of_alpha) {
  return fmt::format(
      R"({{"structure":"fractional","parameters":{{{}}},"one_sigma":{{"kp":0.002,"b1":0.0004,"b2":0.003,"alpha":{},)"
      R"("beta":0.01}},"correlation":[[1,0,0,0,0],[0,1,0,0.5,0],[0,0,1,0,0],[0,0.5,0,1,0],[0,0,0,0,1]]}})",
      kPromptPlant, sigma_of_alpha);
}

TEST_F(LoopTools, TuneSaysHowUncertainTheMarginIsByTheSigmasOfAFit) {
  save("fit.json", fit_file("0.02"));
  const std::string spec = " --crossover-rad-s 3 --phase-margin-deg 90";
  const auto achieved = ask("tune --plant @fit.json --json" + spec).json()["achieved"];
  const double sigma_deg = achieved["phase_margin_sigma_deg"];
  EXPECT_GT(sigma_deg, 0.1);
  EXPECT_GT(achieved["crossover_sigma_rad_s"], 0.01);
  const double slope_deg = achieved["phase_slope_sigma_deg_per_rad_s"];
  EXPECT_THAT(ask("tune --plant @fit.json" + spec).text,
              HasSubstr(fmt::format("phase slope ± {:.2g} deg/(rad/s)", 2 * slope_deg)));
  EXPECT_THAT(ask("tune --plant @fit.json" + spec).text,
              HasSubstr(fmt::format("(± 2 sd): phase margin ± {:.2g} deg, gain crossover ± ", 2 * sigma_deg)));
  save("fit.json", fit_file("null"));
  EXPECT_EQ(ask("tune --plant @fit.json --json" + spec).json()["achieved"]["phase_margin_sigma_deg"], nullptr);
  EXPECT_THAT(ask("tune --plant @fit.json" + spec).text, HasSubstr("are not known: the margin takes them as exact"));
  EXPECT_THAT(ask("tune" + spec).text, Not(HasSubstr("sigmas")));
}

TEST_F(LoopTools, TuneWithAGivenMuReturnsThePapersController) {
  const auto json = ask("tune --crossover-rad-s 5.9995012056 --phase-margin-deg 64.99778607 --mu 0.6524 --json").json();
  EXPECT_NEAR(json["kp"], 65.0028, 1e-3);
  EXPECT_NEAR(json["kd"], 0.0305, 1e-6);
  EXPECT_EQ(json["mu"], 0.6524);
}

TEST_F(LoopTools, TuneSaysWhyThePapersSpecificationHasNoSolution) {
  const Answer answer = ask("tune --crossover-rad-s 65 --phase-margin-deg 72 --json");
  EXPECT_EQ(answer.exit_code, 3);
  const auto json = answer.json();
  EXPECT_EQ(json["feasible"], false);
  EXPECT_THAT(json["reason"].get<std::string>(), HasSubstr("107"));
  EXPECT_LT(json["nearest"]["phase_margin_deg"], 22.38);
  EXPECT_GT(json["nearest"]["kp"], 0);
  EXPECT_FALSE(json.contains("kp"));
  const Answer table = ask("tune --crossover-rad-s 65 --phase-margin-deg 72");
  EXPECT_EQ(table.exit_code, 3);
  EXPECT_THAT(table.error, HasSubstr("not feasible"));
  EXPECT_THAT(table.text, HasSubstr("nearest"));
}

TEST_F(LoopTools, TheMapOfTuneHasTheMarginsOfEachCrossoverInThreeForms) {
  const auto map = ask("tune --map --from-rad-s 3 --to-rad-s 12 --points 3 --json").json();
  ASSERT_EQ(map["points"].size(), 3U);
  EXPECT_EQ(map["points"][0]["reason"], "feasible");
  EXPECT_NEAR(map["points"][0]["lowest_phase_margin_deg"], 88.61, 0.01);
  EXPECT_NEAR(map["points"][0]["highest_phase_margin_deg"], 149.16, 0.01);
  EXPECT_EQ(map["points"][0]["ranges_deg"].size(), 1U);
  EXPECT_EQ(map["points"][2]["reason"], "phase_falls_too_fast");
  EXPECT_EQ(map["points"][2]["highest_phase_margin_deg"], nullptr);
  EXPECT_EQ(map["asked"]["to_rad_s"], 12);
  const std::string csv = ask("tune --map --from-rad-s 3 --to-rad-s 12 --points 3 --csv").text;
  EXPECT_THAT(csv, HasSubstr("crossover_rad_s,lowest_phase_margin_deg,highest_phase_margin_deg,reason\n3,88.6"));
  EXPECT_THAT(csv, HasSubstr("\n12,,,phase_falls_too_fast\n"));
  EXPECT_THAT(ask("tune --map --from-rad-s 3 --to-rad-s 12 --points 3").text, HasSubstr("88.61 to 149.16"));
}

TEST_F(LoopTools, TuneNeedsASpecificationUnlessAMapIsAskedFor) {
  EXPECT_THAT(ask("tune --phase-margin-deg 90").error, HasSubstr("--crossover-rad-s is required"));
  EXPECT_THAT(ask("tune --crossover-rad-s 3").error, HasSubstr("--phase-margin-deg is required"));
  EXPECT_THAT(ask("tune --crossover-rad-s 3 --phase-margin-deg 90 --csv").error, HasSubstr("--csv requires --map"));
  EXPECT_THAT(ask("tune --map --crossover-rad-s 3").error, HasSubstr("excludes"));
  EXPECT_THAT(ask("tune --crossover-rad-s 3 --phase-margin-deg 90 --points 3").error,
              HasSubstr("--points requires --map"));
  EXPECT_THAT(ask("tune --map --from-rad-s 5 --to-rad-s 2").error, HasSubstr("to_rad_s must be above from_rad_s"));
}

TEST_F(LoopTools, BodeAndTuneSayWhatTheHoldOfTheDutyCosts) {
  const auto bode = ask("bode --json").json();
  EXPECT_NEAR(bode["phase_margin_deg"], 65.00, 0.01) << "the paper's, of the continuous loop";
  EXPECT_NEAR(bode["gain_margin_db"], 23.29, 0.01);
  EXPECT_NEAR(bode["sampled"]["phase_margin_deg"], 63.28, 0.01);
  EXPECT_NEAR(bode["sampled"]["gain_margin_db"], 19.55, 0.01);
  EXPECT_EQ(bode["sampled"]["period_s"], 0.01);
  EXPECT_NEAR(ask("bode --period-s 0 --json").json()["sampled"]["phase_margin_deg"], 65.00, 0.01);
  EXPECT_THAT(ask("bode").text, HasSubstr("as the robot runs it"));
  const auto tuned = ask("tune --crossover-rad-s 5 --phase-margin-deg 91 --json").json();
  EXPECT_NEAR(tuned["sampled"]["phase_margin_deg"], 89.57, 0.01);
  EXPECT_EQ(tuned["asked"]["period_s"], 0.01);
  const Answer refused = ask("tune --crossover-rad-s 60 --phase-margin-deg 15");
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.error, HasSubstr("unstable as the robot runs it"));
  EXPECT_EQ(ask("tune --crossover-rad-s 60 --phase-margin-deg 15 --period-s 0").exit_code, 0);
  const auto unsampled = ask("tune --map --from-rad-s 58 --to-rad-s 70 --points 2 --period-s 0 --json").json();
  const auto sampled = ask("tune --map --from-rad-s 58 --to-rad-s 70 --points 2 --json").json();
  EXPECT_LT(unsampled["points"][1]["lowest_phase_margin_deg"].get<double>() + 5,
            sampled["points"][1]["lowest_phase_margin_deg"].get<double>());
}

TEST_F(LoopTools, TuneTableShowsAskedBesideAchieved) {
  const Answer answer = ask("tune --crossover-rad-s 5 --phase-margin-deg 91");
  EXPECT_THAT(answer.text, HasSubstr("asked"));
  EXPECT_THAT(answer.text, HasSubstr("kp = 49.41"));
}

TEST_F(LoopTools, TuneCallsNoMarginFeasibleThatItRefuses) {
  save("resonant.json", R"({"kp":0.4,"b1":0.01,"b2":0.02,"b3":1,"alpha":1.9,"beta":0.5})");
  const auto json = ask("tune --plant @resonant.json --crossover-rad-s 5 --phase-margin-deg 100 --json").json();
  EXPECT_THAT(json["reason"].get<std::string>(), HasSubstr("unstable"));
  const auto& ends = json["feasible_phase_margins_deg"];
  for (std::size_t i = 0; i + 1 < ends.size(); i += 2) {
    EXPECT_FALSE(ends[i].get<double>() < 100 && 100 < ends[i + 1].get<double>()) << ends;
  }
  const auto granted = ask("tune --crossover-rad-s 5 --phase-margin-deg 91 --json").json();
  EXPECT_EQ(granted["feasible_phase_margins_deg"].size(), 2u);
  EXPECT_THAT(ask("tune --crossover-rad-s 5 --phase-margin-deg 91").text,
              HasSubstr("iso-damped phase margins at 5 rad/s: "));
}

TEST_F(LoopTools, ATuningIsAControllerFile) {
  save("c.json", ask("tune --crossover-rad-s 5 --phase-margin-deg 91 --json").text);
  EXPECT_NEAR(ask("bode --controller @c.json --json").json()["phase_margin_deg"], 91, 1e-7);
  save("none.json", ask("tune --crossover-rad-s 65 --phase-margin-deg 72 --json").text);
  EXPECT_THAT(ask("bode --controller @none.json").error, HasSubstr("not feasible"));
}

TEST_F(LoopTools, EstimatorGivesTheRobotsParametersOfAPlant) {
  const Answer answer = ask("estimator --plant newtonian --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  const auto json = answer.json();
  EXPECT_EQ(json.size(), 4u);
  ASSERT_EQ(json["model_gain_m_s"].size(), 4u);
  ASSERT_EQ(json["model_time_constant_s"].size(), 4u);
  double steady_gain_m_s = 0;
  for (const auto& gain_m_s : json["model_gain_m_s"]) steady_gain_m_s += gain_m_s.get<double>();
  EXPECT_NEAR(steady_gain_m_s, 232 / 667.1, 1e-5);
  EXPECT_LT(json["fit_error"], 2e-5);
  save("again.json", json["plant"].dump());
  EXPECT_EQ(ask("estimator --plant @again.json --json").text, answer.text);

  const Answer table = ask("estimator");
  EXPECT_EQ(table.exit_code, 0);
  EXPECT_THAT(table.text, HasSubstr("model_time_constant_4_s"));
  EXPECT_THAT(table.text, HasSubstr("the robot can use this model"));
}

TEST_F(LoopTools, EstimatorRefusesAPlantThatSwings) {
  save("swing.json", R"({"kp":0.1,"b1":0.005682,"b2":0.05,"alpha":1.95,"beta":0.8682})");
  const Answer answer = ask("estimator --plant @swing.json --json");
  EXPECT_EQ(answer.exit_code, 3);
  EXPECT_THAT(answer.json()["refused"].get<std::string>(), HasSubstr("overshoots"));
  EXPECT_GT(answer.json()["fit_error"], 0.005);
  EXPECT_TRUE(answer.json().contains("plant"));
  EXPECT_FALSE(answer.json().contains("model_gain_m_s"));
  const Answer table = ask("estimator --plant @swing.json");
  EXPECT_EQ(table.exit_code, 3);
  EXPECT_THAT(table.error, HasSubstr("the robot cannot use a model of this plant: four first-order sections"));
}

TEST_F(LoopTools, ModelShowsThePresetsAndTheDerivedNumerator) {
  const Answer table = ask("model");
  ASSERT_EQ(table.exit_code, 0) << table.error;
  EXPECT_THAT(table.text, HasSubstr("-18.4249 +- 6.76898j"));
  EXPECT_THAT(table.text, HasSubstr("newtonian (28)"));
  const auto json = ask("model --json").json();
  EXPECT_NEAR(json["hydrodynamic"]["model"]["b2"], 60.1099, 1e-4);
  EXPECT_NEAR(json["hydrodynamic"]["derived_numerator"], 3.5554, 1e-4);
  EXPECT_NEAR(json["newtonian"]["poles_rad_s"][1]["real"], -45.4534445283, 1e-9);
  EXPECT_NEAR(json["non_newtonian"]["dc_gain_m_s"], 0.1, 1e-12);
}

TEST_F(LoopTools, ModelFitsTheMotorAndUsesIt) {
  std::string csv = "t_s,duty,rate_rad_s\n";
  double rate_rad_s = 0;
  for (int k = 0; k < 200; ++k) {
    const double duty = k / 40 % 2 == 0 ? 0.5 : -0.2;
    csv += std::to_string(0.005 * k) + "," + std::to_string(duty) + "," + std::to_string(rate_rad_s) + "\n";
    rate_rad_s += (1 - std::exp(-0.005 / 0.03)) * (600 * duty - rate_rad_s);
  }
  save("motor.csv", csv);
  const auto json = ask("model --motor-csv @motor.csv --json").json();
  EXPECT_NEAR(json["motor_fit"]["gain_rad_s"], 600, 1e-3);
  EXPECT_NEAR(json["hydrodynamic"]["parameters"]["motor_time_constant_s"], 0.03, 1e-6);
  EXPECT_THAT(ask("model --motor-csv @motor.csv").text, HasSubstr("gain km"));
}

TEST_F(LoopTools, APresetIsAModelFile) {
  save("m.json", ask("model --preset newtonian").text);
  EXPECT_NEAR(ask("bode --plant @m.json --json").json()["gain_crossover_rad_s"], 15.98298126, 1e-8);
  const auto heavy = ask("model --preset hydrodynamic --mass-kg 1").json();
  EXPECT_LT(heavy["b2"], 60);
}

}  // namespace
}  // namespace server::cli
