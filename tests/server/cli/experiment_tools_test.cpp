// The fixed forms of identify, discretise and predict, with the numbers of the paper's plant and controller.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <numeric>
#include <sstream>

#include "server/cli/terminal/output.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Discretising : public ToolTest {};

TEST_F(Discretising, DirectGivesTheReferenceSections) {
  const Answer answer = ask("discretise --period-s 0.01 --order 5 --method direct --a 0.5 --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  const auto json = answer.json();
  EXPECT_EQ(json["numerator"].size(), 6u);
  EXPECT_EQ(json["denominator"][0], 1.0);
  EXPECT_NEAR(json["dc_gain"], 65.0028, 1e-9);
  EXPECT_EQ(json["sections"]["first_order"].size(), 5u);
  double largest_pole = 0;
  for (const auto& section : json["sections"]["first_order"]) {
    largest_pole = std::max(largest_pole, section["pole"].get<double>());
  }
  EXPECT_NEAR(largest_pole, 0.97084, 1e-5);
  EXPECT_NEAR(json["errors"]["max_deg"], 13.4, 0.1);
  EXPECT_EQ(json["is_stable"], true);
}

TEST_F(Discretising, ExplainsItsChoiceWhenNoMethodIsGiven) {
  const auto json = ask("discretise --json").json();
  EXPECT_FALSE(json["reason"].get<std::string>().empty());
  EXPECT_GT(json["compared"].size(), 2u);
  const Answer table = ask("discretise");
  EXPECT_THAT(table.text, HasSubstr("noise gain"));
  EXPECT_THAT(table.text, HasSubstr("oustaloup"));
  EXPECT_EQ(ask("discretise --method oustaloup --json").json()["method"], "oustaloup");
}

TEST_F(Discretising, PublishesNoCoefficientsThatCannotHoldTheSections) {
  const auto json = ask("discretise --method oustaloup --period-s 0.001 --order 8 --json").json();
  EXPECT_TRUE(json["numerator"].is_null());
  EXPECT_TRUE(json["denominator"].is_null());
  EXPECT_FALSE(json["transfer_note"].get<std::string>().empty());
  EXPECT_EQ(json["sections"]["first_order"].size(), 8u);
  EXPECT_THAT(ask("discretise --method oustaloup --period-s 0.001 --order 8").text, HasSubstr("run the sections"));
}

TEST_F(Discretising, ListsWhatItRefused) {
  const auto json = ask("discretise --period-s 0.001 --order 1 --json").json();
  EXPECT_EQ(json["refused"].size(), 6u);
  EXPECT_THAT(json["refused"][0]["name"].get<std::string>(), HasSubstr("a = 0"));
  EXPECT_THAT(ask("discretise --period-s 0.001 --order 1").text, HasSubstr("refused: the direct method"));
}

TEST_F(Discretising, PrintsTheControllerAsSourceText) {
  EXPECT_THAT(ask("discretise --code c").text, HasSubstr("double rheonaut_controller_step("));
  EXPECT_THAT(ask("discretise --code matlab").text, testing::StartsWith("function [duty, state] = "));
  EXPECT_EQ(ask("discretise --code c --json").exit_code, 2);
}

TEST_F(Discretising, SaysWhenTheCoefficientsAreNotTheControllerAnyMore) {
  EXPECT_TRUE(ask("discretise --json").json()["warnings"].empty());
  EXPECT_THAT(ask("discretise --period-s 0.1 --method direct").text, HasSubstr("warning: below 25.1 rad/s"));
  EXPECT_EQ(ask("discretise --period-s 0.1 --method direct --json").json()["warnings"].size(), 1u);
}

class Predicting : public ToolTest {};

TEST_F(Predicting, GivesTheReferenceMetrics) {
  const Answer answer = ask("predict --method direct --a 0.5 --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  const auto json = answer.json();
  EXPECT_NEAR(json["step"]["settling_s"], 1.15, 0.011);
  // The reference case runs the fit as it is, with 0.9 % more gain at rest, and has 0.45.
  EXPECT_NEAR(json["step"]["overshoot_percent"], 0.4175, 1e-3);
  EXPECT_NEAR(json["disturbance"]["settling_s"], 0.63, 0.011);
  EXPECT_EQ(json["t_s"].size(), json["duty"].size());
  EXPECT_EQ(json["experiment"]["setpoint_m"], 0.1);
}

TEST_F(Predicting, AOneWayMotorNeverArrivesInWater) {
  const Answer answer = ask("predict --plant newtonian --duty-min 0 --method direct");
  EXPECT_THAT(answer.text, HasSubstr("never"));
  EXPECT_THAT(answer.text, HasSubstr("20.40"));
}

TEST_F(Predicting, PrintsSamplesAndRobustness) {
  const Answer csv = ask("predict --duration-s 1 --csv");
  EXPECT_THAT(csv.text, ::testing::StartsWith("t_s,position_m,velocity_m_s,measured_m,duty,reference_m\n0,0,"));
  const Answer table = ask("predict --duration-s 1 --robustness");
  EXPECT_THAT(table.text, HasSubstr("0 to 1"));
  EXPECT_THAT(ask("tune --crossover-rad-s 3 --phase-margin-deg 90 --robustness").text, HasSubstr("robustness"));
}

TEST_F(Predicting, SaysPlainlyThatALoopIsUnstable) {
  save("strong.json", R"({"kp":3,"b1":0.005682,"b2":0.11031,"b3":1,"alpha":1.7263,"beta":0.8682})");
  const auto limited = ask("predict --plant @strong.json --json").json();  // the duty's limits hold it
  EXPECT_EQ(limited["is_diverging"], false);
  const auto robustness = ask("predict --plant @strong.json --robustness --json").json()["robustness"];
  EXPECT_TRUE(robustness["duty_sd_per_noise_sd"].is_null());
  EXPECT_EQ(robustness["rows"][0]["is_stable"], false);
  EXPECT_THAT(ask("predict --plant @strong.json --robustness").text, HasSubstr("none, the loop is not stable"));
}

TEST(Cells, HaveNoSignOnZero) {
  EXPECT_EQ(fixed(-1e-9, 3), "0.000");
  EXPECT_EQ(fixed(-0.0, 0), "0");
  EXPECT_EQ(fixed(-0.5, 2), "-0.50");
  EXPECT_EQ(cell(-0.0), "0");
  EXPECT_EQ(cell(-1e-9, 2), "-1e-09");
}

class Identifying : public ToolTest {};

TEST_F(Identifying, FindsTheModelOfACleanRecordingWhichIsThenAPlant) {
  save("run.csv", ask("step --duty 0.3 --every-s 0.01 --until-s 5 --csv").text);
  const Answer answer = ask("identify --csv @run.csv --structure fractional --json");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  const auto json = answer.json();
  EXPECT_NEAR(json["parameters"]["alpha"], 1.7263, 1e-4);
  EXPECT_NEAR(json["parameters"]["kp"], 0.1, 1e-6);
  EXPECT_TRUE(json["one_sigma"].contains("beta"));
  EXPECT_LT(json["sse"], 1e-9);
  EXPECT_GT(json["fit_percent"], 99.99);
  EXPECT_TRUE(json["warnings"].is_array());
  save("m.json", answer.text);
  const auto again = ask("step --plant @m.json --times 5 --json").json();
  EXPECT_NEAR(again["velocity_m_s"][0], 0.0298827143987, 1e-8);
}

TEST_F(Identifying, SaysWhetherTheRobotsEstimatorCanUseIt) {
  save("run.csv", ask("step --duty 0.3 --every-s 0.01 --until-s 5 --csv").text);
  const std::string identify = "identify --csv @run.csv --structure fractional";
  const Answer answer = ask(identify + " --json");
  const auto settings = answer.json()["estimator"];
  EXPECT_EQ(settings["model_gain_m_s"].size(), 4u);
  EXPECT_EQ(settings["model_time_constant_s"].size(), 4u);
  EXPECT_LT(settings["fit_error"], 0.002);
  save("m.json", answer.text);
  EXPECT_EQ(ask("bode --plant @m.json").exit_code, 0);
  EXPECT_EQ(ask("estimator --plant @m.json --json").json()["model_gain_m_s"], settings["model_gain_m_s"]);
  EXPECT_THAT(ask(identify).text, HasSubstr("the robot's estimator can use it, with a fit error of 0.1"));

  save("swing.json", R"({"kp":0.1,"b1":0.01,"b2":0.05,"alpha":2,"beta":1})");
  save("swing.csv", ask("step --plant @swing.json --every-s 0.01 --until-s 3 --csv").text);
  const auto refused = ask("identify --csv @swing.csv --structure second_order --json").json()["estimator"];
  EXPECT_THAT(refused["refused"].get<std::string>(), HasSubstr("overshoots"));
  EXPECT_FALSE(refused.contains("model_gain_m_s"));
}

TEST_F(Identifying, MarksTheSigmaOfAnOrderAtItsBound) {
  save("swing.json", R"({"kp":0.1,"b1":0.01,"b2":0.05,"alpha":2,"beta":1})");
  save("swing.csv", ask("step --plant @swing.json --every-s 0.01 --until-s 3 --csv").text);
  const std::string text = ask("identify --csv @swing.csv --structure fractional").text;
  EXPECT_THAT(text, testing::ContainsRegex("alpha +2 +[^ ]+ +means little: the parameter lies at its bound"));
  EXPECT_THAT(ask("identify --csv @swing.csv --structure second_order").text, Not(HasSubstr("means little")));
}

TEST_F(Identifying, WarnsOfACsvThatBeginsInMotion) {
  std::istringstream whole{ask("step --duty 0.3 --every-s 0.01 --until-s 5 --csv").text};
  std::string late, line;
  for (int i = 0; std::getline(whole, line); ++i) {
    if (i == 0 || i > 30) late += line + "\n";
  }
  save("late.csv", late);
  const Answer answer = ask("identify --csv @late.csv --structure first_order --json");
  EXPECT_THAT(answer.error, HasSubstr("rheonaut: warning: the recording begins in motion, at about 0.0"));
  EXPECT_THAT(answer.json()["warnings"].back().get<std::string>(), HasSubstr("assumes rest"));
  for (const char* every : {"0.01", "0.02", "0.05"}) {
    save("run.csv", ask(std::string{"step --until-s 5 --csv --every-s "} + every).text);
    EXPECT_EQ(ask("identify --csv @run.csv --structure first_order").error, "") << every;
  }
}

TEST_F(Identifying, ComparesTheStructuresInATable) {
  save("run.csv", ask("step --duty 0.3 --every-s 0.02 --until-s 3 --csv").text);
  const Answer table = ask("identify --csv @run.csv");
  EXPECT_EQ(table.exit_code, 0) << table.error;
  EXPECT_THAT(table.text, HasSubstr("first_order"));
  EXPECT_THAT(table.text, HasSubstr("one sigma"));
}

TEST_F(Identifying, HasNoModelWhenTimeRunsOut) {
  save("run.csv", ask("step --duty 0.3 --every-s 0.01 --until-s 5 --csv").text);
  const Answer answer = ask("identify --csv @run.csv --structure fractional --time-limit-s 0.000001 --json");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_EQ(answer.text, "");
  EXPECT_THAT(answer.error, HasSubstr("the search reached its time limit, 1e-06 s, so there is no model: raise "
                                      "--time-limit-s"));
}

TEST_F(Identifying, NumbersBeyondAllBoundsAreNoSuccess) {
  std::string csv = "t_s,duty,position_m\n";
  for (int k = 0; k < 60; ++k) csv += fmt::format("{},0.3,{}\n", 0.01 * k, 1e200 * k);
  save("huge.csv", csv);
  const Answer answer = ask("identify --csv @huge.csv --structure first_order");
  EXPECT_NE(answer.exit_code, 0);
  EXPECT_NE(answer.error, "");
  EXPECT_THAT(answer.text, Not(HasSubstr("inf")));
}

TEST_F(Identifying, APlanPredictsTheUncertaintyOfAnExperiment) {
  const auto prbs = ask("identify --plan --json").json();
  EXPECT_NEAR(prbs["one_sigma"]["alpha"], 0.021, 0.006);
  EXPECT_THAT(ask("identify --plan --plan-duty step --plan-amplitude 0.3").text, HasSubstr("relative (%)"));
  EXPECT_EQ(ask("identify --plan --plan-dt-s 1e-9").exit_code, 2);
}

// A robot that does not move, with a sensor that trembles.
TEST_F(Identifying, ARunThatTheModelDoesNotExplainEndsWithStatus4) {
  std::string csv = "t_s,duty,velocity_m_s\n";
  for (int k = 0; k < 200; ++k) csv += fmt::format("{},0.3,{}\n", 0.01 * k, 1e-3 * ((k * 7919) % 101 - 50));
  save("still.csv", csv);
  const Answer answer = ask("identify --csv @still.csv --structure first_order");
  EXPECT_EQ(answer.exit_code, 4);
  EXPECT_THAT(answer.error, HasSubstr("of the run, so its parameters say nothing"));
}

}  // namespace
}  // namespace server::cli
