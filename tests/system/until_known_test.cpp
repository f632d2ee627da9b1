// An experiment that goes on until the order of the fluid is known: the default sensor, and fits as jobs of the
// station.
#include <cmath>

#include "control/models/plant_models.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/api/experiments/fit_of_runs.hpp"
#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

using nlohmann::json;

constexpr const char* kFast = "kind = \"prbs\"\namplitude = 0.6\nbit_s = 0.2\nfor_s = 10";
constexpr const char* kWeak = "kind = \"prbs\"\namplitude = 0.1\nbit_s = 0.2\nfor_s = 10";

class UntilKnownExperiment : public ExperimentTest {
 protected:
  UntilKnownExperiment() {
    clock.add_worker(recording->jobs.worker());
    api::connect_fits(*experiments, {clock, analysis_, recording->jobs});
    sim_robot::SimulatedRobotConfig config;
    config.world.imu.emplace();
    begin(std::move(config));
  }
  ~UntilKnownExperiment() override {  // before what the fits read from
    tasks.stop();
    clock.settle();
  }

  static std::string until_alpha(double sigma, std::initializer_list<const char*> steps, int most_runs = 4) {
    return profile(steps, fmt::format("until = \"sigma(alpha) <= {}\"\nmost_runs = {}\n[conditions]\nstart = \"back\"\n"
                                      "[limits]\nposition_max_m = 0.5\nposition_min_m = -0.5\n",
                                      sigma, most_runs));
  }
  static json knowledge_after(const storage::Experiment& experiment, std::size_t run) {
    return json::parse(experiment.runs.at(run).knowledge);
  }

  // In place of real fits: so much later one says that alpha is hardly known.
  void fits_take(microseconds time) {
    experiments->set_fit_of_runs([this, time](server::experiments::FitRequest request)
                                     -> boost::asio::awaitable<Result<server::experiments::FittedModel>> {
      const std::int64_t ends_us = clock.steady_us() + time.count();
      while (request.is_wanted() && clock.steady_us() < ends_us) co_await clock.sleep_for(100ms);
      if (!request.is_wanted()) co_return server::fail(ErrorCode::conflict, "not wanted", "fit_failed");
      server::experiments::FittedModel fitted;
      fitted.model = control::kNonNewtonianModel;
      fitted.one_sigma[3] = 0.5;
      fitted.residual_sd = 0.05;
      fitted.end = "converged";
      co_return fitted;
    });
  }

 private:
  analysis::AnalysisService analysis_{recording->history, maths};
};

TEST_F(UntilKnownExperiment, EndsWithTheOrderOfTheFluidKnownAsWellAsWanted) {
  const auto id = start(until_alpha(0.09, {kWeak, kFast}));
  const storage::Experiment ended = until(id, ExperimentState::done, 300s);
  EXPECT_EQ(ended.reason, "target_reached") << ended.detail;
  ASSERT_FALSE(ended.runs.empty());
  EXPECT_LT(ended.runs.size(), 4U);
  for (const storage::ExperimentRun& run : ended.runs) {
    EXPECT_EQ(json::parse(run.variant).at("step"), 2) << "it tells more, and stays within the limits";
    EXPECT_EQ(json::parse(run.steps).at(0).at("step"), 2);
  }
  const json last = knowledge_after(ended, ended.runs.size() - 1);
  const double sigma = last.at("sigma").get<double>(),
               alpha = last.at("fit").at("parameters").at("alpha").get<double>();
  EXPECT_LE(sigma, 0.09);
  EXPECT_NEAR(alpha, control::kNonNewtonianModel.alpha, 4 * sigma) << "the simulated fluid's";
  const auto job = wait_for(recording->jobs.find(last.at("fit").at("job_id").get<storage::JobId>()));
  ASSERT_TRUE(job);
  EXPECT_EQ(job->request.owner, "anna");
  EXPECT_EQ(state().context.mode, rheonaut_MODE_MANUAL);
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
}

TEST_F(UntilKnownExperiment, SaysWhyTheTargetCannotBeReached) {
  fits_take(1s);
  const auto id = start(until_alpha(0.0001, {kFast}));
  const storage::Experiment ended = until(id, ExperimentState::done, 300s);
  EXPECT_EQ(ended.reason, "target_out_of_reach");
  EXPECT_NE(ended.detail.find("would bring it to"), std::string::npos) << ended.detail;
  ASSERT_EQ(ended.runs.size(), 2U);
  EXPECT_EQ(wait_for(runs->find(*ended.runs[1].run))->conditions.name, "of a test (2 of at most 4)");
}

// SAFETY: while a fit is computed the robot is at rest, and an abort ends both at once.
TEST_F(UntilKnownExperiment, AnAbortDuringAFitEndsItAndTheFit) {
  fits_take(100s);
  const auto id = start(until_alpha(0.0001, {kFast}));
  ASSERT_TRUE(clock.run_until([&] { return !view(id).activity.empty(); }, 60s));
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
  ASSERT_TRUE(wait_for(experiments->abort(id, "enough", {"boris", "", 0})));
  expect_aborted(id, "requested", 2s);
  EXPECT_EQ(view(id).experiment.runs.size(), 1U) << "no further run began";
}

// SAFETY: nobody's robot goes on after a fit for somebody who has left meanwhile.
TEST_F(UntilKnownExperiment, NoFurtherRunBeginsForSomebodyWhoHasLeft) {
  fits_take(10s);
  const auto id = start(until_alpha(0.0001, {kFast}));
  ASSERT_TRUE(clock.run_until([&] { return !view(id).activity.empty(); }, 60s));
  leave("anna");
  expect_aborted(id, "nobody_present");
  EXPECT_EQ(view(id).experiment.runs.size(), 1U);
}

// SAFETY: nor after an emergency stop.
TEST_F(UntilKnownExperiment, AStopDuringAFitEndsIt) {
  fits_take(100s);
  const auto id = start(until_alpha(0.0001, {kFast}));
  ASSERT_TRUE(clock.run_until([&] { return !view(id).activity.empty(); }, 60s));
  wait_for(station.emergency_stop({"sim-1", "boris", "", "", 0}, 1s));
  EXPECT_EQ(until(id, ExperimentState::aborted, 2s).reason, "emergency_stop");
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
}

// SAFETY: who cuts the motor's supply at the tube, and resets that, has not said that the robot may move again.
TEST_F(UntilKnownExperiment, ALatchDuringAFitEndsItAlsoWhenItIsResetBeforeTheNextRun) {
  fits_take(20s);
  const auto id = start(until_alpha(0.0001, {kFast}));
  ASSERT_TRUE(clock.run_until([&] { return !view(id).activity.empty(); }, 60s));
  robot->world().cut_motor_supply(true);
  clock.run_for(500ms);
  robot->world().cut_motor_supply(false);
  clock.run_for(500ms);
  ASSERT_TRUE(command_by("anna", sim_robot::clear_emergency(state().context.emergency_id)));
  clock.run_for(1s);
  expect_aborted(id, "emergency");
}

}  // namespace
}  // namespace server
