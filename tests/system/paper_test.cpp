// Section 5 of the paper, from nothing to the report, by the station's own calls and with the default sensor; and the
// same closed loops with the perfect sensor, on the golden ones.
//
// What is judged is the true position: the robot steers by its estimate, and where it really is only the simulated
// world knows. docs/simulator.md says how often it keeps these bounds.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "control/models/plant_models.hpp"
#include "sim_robot/lab/experiment.hpp"
#include "tests/server/cli/tool_test.hpp"
#include "tests/system/paper_fixture.hpp"

namespace server {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

// Of controller (30).
constexpr double kLongestSettling_s = 1.4;
constexpr double kLargestOvershoot_percent = 2.5;
constexpr double kLargestError_m = 0.002;
constexpr double kLargestErrorInWater_m = 0.004;

const json kPaperController{{"kp", 65.0028}, {"kd", 0.0305}, {"mu", 0.6524}};

std::vector<std::string> warnings_of(const json& fit) { return fit.at("warnings").get<std::vector<std::string>>(); }
std::int64_t run_of(const json& experiment) { return experiment.at("runs").back().at("run_id"); }

// The closed loop of (30) with an exact position, computed by other means.
json golden(const char* plant) {
  const json all = json::parse(std::ifstream(TEST_DATA_DIR "/closed_loop_cases.json"));
  for (const json& row : all.at("sampled")) {
    const bool is_nominal = row["duty_limits"] == "-1..1" && row["recurrence_memory"] == "unsaturated";
    if (row["plant"] == plant && is_nominal) return row;
  }
  return nullptr;
}

class Section5Test : public PaperTest {
 protected:
  // The result has every number by which the robot is sent it; what the robot reports is compared bit for bit.
  void push(const json& design) {
    const json pushed = post(fmt::format("{}/controller", kRobot), {{"design_id", design.at("design_id")}});
    EXPECT_TRUE(pushed.at("verified")) << pushed;
    EXPECT_EQ(pushed.at("in_force").at("controller"), pushed.at("command").at("arguments").at("controller"));
    in_force_ = pushed.at("in_force").at("controller");
  }

  json keep(const char* kind, const std::string& name, const json& more) {
    json body{{"kind", kind}, {"name", name}};
    body.update(more);
    return post("/api/v1/designs", body);
  }

  void give_model(const std::string& fluid, const json& model) {
    post(fmt::format("/api/v1/fluids/{}/model", fluid), model);
    EXPECT_EQ(name_fluid(fluid), "confirmed");
  }

  // --- the stages, in their order ---

  void a_step_does_not_determine_alpha() {
    const json step = perform("figure_5");
    const json fit = computed({{"kind", "identify"}, {"run_id", run_of(step)}, {"time_limit_s", kPatience_s}});
    EXPECT_THAT(fit.at("channels"), testing::ElementsAre("acceleration_m_s2")) << "the position is an estimate";
    EXPECT_THAT(warnings_of(fit), Contains(AllOf(HasSubstr("cannot determine"), HasSubstr("alpha"))));
  }

  // The second PRBS is not fitted: the model is tried on it.
  json the_identification_set_determines_it() {
    constexpr double kSecondPrbsFrom_s = 129;
    const json set = perform("identification_set");
    const json fit = computed({{"kind", "identify"},
                               {"run_id", run_of(set)},
                               {"to_s", kSecondPrbsFrom_s},
                               {"validation_run_id", run_of(set)},
                               {"validation_from_s", kSecondPrbsFrom_s},
                               {"time_limit_s", kPatience_s}});
    EXPECT_LT(fit.at("one_sigma").at("alpha"), kTrustedSigma);
    EXPECT_THAT(warnings_of(fit), Not(Contains(HasSubstr("cannot determine"))));
    EXPECT_GT(fit.at("validation").at("fit_percent"), 90) << "on what was not fitted";
    const control::FractionalModel truth_of_it = control::kNonNewtonianModel;
    const std::pair<const char*, double> parameters[] = {
        {"kp", truth_of_it.kp}, {"b2", truth_of_it.b2}, {"alpha", truth_of_it.alpha}, {"beta", truth_of_it.beta}};
    for (const auto& [name, value] : parameters) {
      EXPECT_NEAR(fit.at("parameters").at(name), value, 3 * fit.at("one_sigma").at(name).get<double>()) << name;
    }
    return fit;
  }

  void what_the_paper_asks_for_is_refused_with_an_offer(const json& model) {
    const json tuned = computed({{"kind", "tune"},
                                 {"model_id", model.at("design_id")},
                                 {"crossover_rad_s", kPaperCrossover_rad_s},
                                 {"phase_margin_deg", kPaperMargin_deg}});
    ASSERT_FALSE(tuned.at("feasible"));
    EXPECT_THAT(tuned.at("reason"), HasSubstr("would have to add theta = 10"));
    const json& offer = tuned.at("nearest");
    EXPECT_EQ(offer.at("crossover_rad_s"), kPaperCrossover_rad_s);
    EXPECT_TRUE(offer.at("achieved").at("is_closed_loop_stable"));
    const json map = computed({{"kind", "tuning_map"},
                               {"model_id", model.at("design_id")},
                               {"from_rad_s", 3},
                               {"to_rad_s", kPaperCrossover_rad_s},
                               {"points", 2}});
    const json& at_3 = map.at("points").front();
    EXPECT_LT(at_3.at("lowest_phase_margin_deg"), 90);
    EXPECT_GT(at_3.at("highest_phase_margin_deg"), 90);
    const double highest_deg = map.at("points").back().at("highest_phase_margin_deg");
    EXPECT_LT(highest_deg, kPaperMargin_deg);
    EXPECT_NEAR(offer.at("achieved").at("phase_margin_deg"), highest_deg, 0.5) << "the nearest that there is";
  }

  // 3 rad/s and 90 degrees on the identified plant. What was predicted with it is what the robot really does.
  void a_tuned_controller_does_what_was_predicted(const json& model) {
    const json tuned = computed(
        {{"kind", "tune"}, {"model_id", model.at("design_id")}, {"crossover_rad_s", 3}, {"phase_margin_deg", 90}});
    ASSERT_TRUE(tuned.at("feasible"));
    const json design = keep("controller", "3 rad/s, 90 degrees", {{"job_id", last_job()}});
    EXPECT_EQ(design.at("model_id"), model.at("design_id"));
    push(design);
    EXPECT_EQ(in_force_.at("kp").get<float>(), tuned.at("kp").get<float>());
    const json& sections = tuned.at("discretised").at("sections").at("first_order");
    ASSERT_EQ(in_force_.at("pole").size(), sections.size());
    for (std::size_t i = 0; i < sections.size(); ++i) {
      EXPECT_EQ(in_force_.at("pole")[i].get<float>(), sections[i].at("pole").get<float>()) << i;
    }
    const control::StepMetrics step = true_step(perform("figure_7"), 0).measured;
    const json& predicted = tuned.at("predicted").at(0).at("step");
    EXPECT_NEAR(step.settling_s.value_or(0), predicted.at("settling_s"), 0.155);  // both are whole ticks of 0.01 s
    EXPECT_NEAR(step.overshoot_percent, predicted.at("overshoot_percent"), 1);
  }

  static void expect_bounds(const TrueStep& step) {
    EXPECT_LE(step.measured.settling_s.value_or(INFINITY), kLongestSettling_s);
    EXPECT_LE(step.measured.overshoot_percent, kLargestOvershoot_percent);
    EXPECT_LE(std::abs(step.measured.steady_state_error_m), kLargestError_m);
  }

  // In water the model (28) itself overshoots under (30), by 9.8 % of the step and 20 % of the disturbance, so 2.5 %
  // cannot hold: allowed is that, and the error. And where the error may be 4 mm the robot may never come within 2 mm
  // of the setpoint: held is that it comes to rest in time, wherever that is.
  static void expect_bounds_in_water(const TrueStep& step, const char* which) {
    EXPECT_LE(std::abs(step.measured.steady_state_error_m), kLargestErrorInWater_m);
    EXPECT_LE(step.around_end.settling_s.value_or(INFINITY), kLongestSettling_s);
    const double move_m = std::string_view{which} == "step" ? kSetpoint_m : -kDisturbance_m;
    const double of_model_percent = golden("Eq(28)/s").at(which).at("overshoot_pct");
    EXPECT_LE(step.measured.overshoot_percent, of_model_percent + 100 * kLargestErrorInWater_m / move_m);
  }

  // The station measures the same on the true position as the test does; as the controller sees it, with the
  // disturbance.
  void expect_same_by_the_station(const json& experiment, std::initializer_list<TrueStep> steps) {
    import_truth(experiment);
    const json measured = get(fmt::format("/api/v1/runs/{}/metrics", run_of(experiment))).at("steps");
    ASSERT_EQ(measured.size(), steps.size());
    for (std::size_t i = 0; i < measured.size(); ++i) {
      const control::StepMetrics& expected = std::data(steps)[i].measured;
      EXPECT_EQ(measured[i].at("position_source"), "outside");
      EXPECT_EQ(measured[i].at("settling_s").is_null(), !expected.settling_s.has_value());
      EXPECT_NEAR(measured[i].at("peak_m"), expected.peak_m + (i == 0 ? 0 : kDisturbance_m), 2e-4);
      EXPECT_NEAR(measured[i].at("steady_state_error_m"), expected.steady_state_error_m, 1e-4);
    }
  }

  // Every sample is stored, and by the robot's own estimate the error is within 2 sd of the true one.
  void expect_estimate_near_truth(const json& experiment, std::initializer_list<TrueStep> steps) {
    const std::string run = fmt::format("/api/v1/runs/{}", run_of(experiment));
    const json recorded = get(run);
    EXPECT_GE(recorded.at("samples_stored"), static_cast<int>(2 * kPhase_s * 100));
    EXPECT_EQ(recorded.at("samples_stored"), recorded.at("samples_expected"));
    EXPECT_EQ(recorded.at("samples_lost"), 0);
    const json measured = get(run + "/step-metrics").at("steps");
    ASSERT_EQ(measured.size(), steps.size());
    for (std::size_t i = 0; i < measured.size(); ++i) {
      EXPECT_EQ(measured[i].at("position_source"), "estimate");
      const double sd_m = measured[i].at("position_sd_m");
      EXPECT_GT(sd_m, 0);
      EXPECT_NEAR(measured[i].at("steady_state_error_m"), std::data(steps)[i].measured.steady_state_error_m, 2 * sd_m);
    }
  }

  json figure_7() {
    const json experiment = perform("figure_7");
    const TrueStep step = true_step(experiment, 0), disturbance = true_step(experiment, 1);
    expect_bounds(step);
    expect_bounds(disturbance);
    expect_estimate_near_truth(experiment, {step, disturbance});
    expect_same_by_the_station(experiment, {step, disturbance});
    return experiment;
  }

  // Between its two runs a person puts the robot into water and says so.
  std::vector<json> figure_8() {
    const json first = await_experiment(begin_experiment("figure_8"), "paused");
    EXPECT_EQ(first.at("reason"), "fluid") << first;
    const TrueStep in_softener = true_step(first, 0);
    expect_bounds(in_softener);
    expect_same_by_the_station(first, {in_softener});
    move_to("water");
    give_model("water", cli::ask_tool(folder.path(), "estimator --plant newtonian --json").json());
    post(fmt::format("/api/v1/experiments/{}/resume", first.at("experiment_id").get<int>()));
    const json second = await_experiment(first, "done");
    const TrueStep in_water = true_step(second, 0);
    expect_bounds_in_water(in_water, "step");
    expect_same_by_the_station(second, {in_water});
    return {first, second};
  }

  json figure_9() {
    const json experiment = perform("figure_9");
    const TrueStep step = true_step(experiment, 0), disturbance = true_step(experiment, 1);
    expect_bounds_in_water(step, "step");
    expect_bounds_in_water(disturbance, "disturbance");
    expect_same_by_the_station(experiment, {step, disturbance});
    return experiment;
  }

  void the_runs_are_compared_and_reported(const std::vector<json>& experiments) {
    json runs = json::array();
    for (const json& one : experiments) runs.push_back(run_of(one));
    for (const json& run : runs) {
      const json recorded = get(fmt::format("/api/v1/runs/{}", run.get<int>()));
      EXPECT_EQ(recorded.at("controller_checksum"), in_force_.at("checksum")) << "one controller in both fluids";
      EXPECT_EQ(recorded.at("samples_lost"), 0);
    }
    const json traces{{"at", "step"}, {"to_ms", 20000}};
    const json compared = computed({{"kind", "comparison"}, {"runs", runs}, {"traces", traces}});
    const json& of_runs = compared.at("traces").at("runs");
    ASSERT_EQ(of_runs.size(), runs.size());
    for (const json& one : of_runs) EXPECT_EQ(one.at("position_source"), "outside") << one.at("name");
    const json file = computed({{"kind", "report"}, {"runs", runs}, {"traces", traces}});
    const std::string report = ask("GET", file.at("path")).body;
    EXPECT_EQ(report.size(), file.at("size_bytes"));
    EXPECT_TRUE(report.ends_with("</html>\n"));
    for (const json& one : experiments) EXPECT_THAT(report, HasSubstr(one.at("name").get<std::string>()));
    EXPECT_THAT(report,
                AllOf(HasSubstr("<svg"), HasSubstr("<td class=\"differs\">water</td>"),
                      HasSubstr("<td>measured from outside</td>"), Not(HasSubstr("<th class=\"differs\">Controller"))));
  }

  static constexpr double kPaperCrossover_rad_s = 65, kPaperMargin_deg = 72;
  static constexpr double kTrustedSigma = 0.1;  // of an order, above which `identify` warns
  static constexpr int kPatience_s = 600;       // a busy machine ends no search

  json in_force_;  // the controller that was sent last
};

TEST_F(Section5Test, FromAStepTestToClosedLoopsInTwoFluids) {
  boot_in("non_newtonian", true);
  ASSERT_EQ(name_fluid("non_newtonian"), "assumed");
  a_step_does_not_determine_alpha();
  json fit = the_identification_set_determines_it();
  const json model = keep("model", "softener", {{"job_id", last_job()}});
  give_model("non_newtonian", fit.at("estimator"));
  what_the_paper_asks_for_is_refused_with_an_offer(model);
  a_tuned_controller_does_what_was_predicted(model);
  push(keep("controller", "equation (30)", {{"document", kPaperController}}));
  const json seven = figure_7();
  const std::vector<json> eight = figure_8();
  const json nine = figure_9();
  the_runs_are_compared_and_reported({seven, eight[0], eight[1], nine});
}

class GoldenLoopTest : public PaperTest {
 protected:
  // What the controller sees, at the samples of the golden loop.
  static void expect_golden(const json& row, std::initializer_list<TrueStep> steps, double within_m) {
    std::vector<double> seen_m;
    for (const TrueStep& step : steps) {
      const double shift_m = seen_m.empty() ? 0 : kDisturbance_m;
      for (const double position_m : step.position_m) seen_m.push_back(position_m + shift_m);
    }
    std::size_t compared = 0;
    for (std::size_t i = 0; i < row.at("k").size(); ++i) {
      const std::size_t k = row["k"][i];
      if (k >= seen_m.size()) continue;
      EXPECT_NEAR(seen_m[k], row["measured"][i], within_m) << "k = " << k;
      ++compared;
    }
    EXPECT_GT(compared, 40U);
    const control::StepMetrics& first = steps.begin()->measured;
    EXPECT_NEAR(first.settling_s.value_or(0), row["step"]["settling_2pct_s"], 0.015);
    EXPECT_NEAR(first.overshoot_percent, row["step"]["overshoot_pct"], 0.1);
    EXPECT_NEAR(first.steady_state_error_m, 0, 1e-5);
  }

  // The station measures what `rheonaut-sim predict` says of this loop.
  void expect_as_predicted(const json& experiment) {
    const sim_robot::ExperimentResult predicted = sim_robot::run_experiment({});
    const json steps = get(fmt::format("/api/v1/runs/{}/step-metrics", run_of(experiment))).at("steps");
    ASSERT_EQ(steps.size(), 2U);
    EXPECT_NEAR(steps[0].at("settling_s"), predicted.step.settling_s.value_or(0), 0.0101);
    EXPECT_NEAR(steps[0].at("overshoot_percent"), predicted.step.overshoot_percent, 0.05);
    EXPECT_EQ(steps[0].at("position_sd_m"), 0);
  }

  static constexpr double kSameCoefficients_m = 1e-4;
  static constexpr double kSameCoefficientsInWater_m = 2e-4;  // as in sim_robot/experiment_test, which has the reason
};

TEST_F(GoldenLoopTest, WithThePerfectSensor) {
  const json in_softener = golden("Eq(29)"), in_water = golden("Eq(28)/s");
  boot_in("non_newtonian", false);  // with (30), which it boots with, in the coefficients of the golden loops
  name_fluid("non_newtonian");
  const json seven = perform("figure_7");
  expect_golden(in_softener, {true_step(seven, 0), true_step(seven, 1)}, kSameCoefficients_m);
  expect_as_predicted(seven);
  const json first = await_experiment(begin_experiment("figure_8"), "paused");
  expect_golden(in_softener, {true_step(first, 0)}, kSameCoefficients_m);
  move_to("water");
  name_fluid("water");
  post(fmt::format("/api/v1/experiments/{}/resume", first.at("experiment_id").get<int>()));
  expect_golden(in_water, {true_step(await_experiment(first, "done"), 0)}, kSameCoefficientsInWater_m);
  const json nine = perform("figure_9");
  expect_golden(in_water, {true_step(nine, 0), true_step(nine, 1)}, kSameCoefficientsInWater_m);
}

// The station discretises (30) as it finds best, and not as the golden loops do: another method, and nearly one loop.
TEST_F(GoldenLoopTest, WithThePerfectSensorAndTheCoefficientsOfTheStation) {
  boot_in("non_newtonian", false);
  name_fluid("non_newtonian");
  const json design =
      post("/api/v1/designs", {{"kind", "controller"}, {"name", "equation (30)"}, {"document", kPaperController}});
  ASSERT_TRUE(post(fmt::format("{}/controller", kRobot), {{"design_id", design.at("design_id")}}).at("verified"));
  const json seven = perform("figure_7");
  expect_golden(golden("Eq(29)"), {true_step(seven, 0), true_step(seven, 1)}, 1e-3);
}

}  // namespace
}  // namespace server
