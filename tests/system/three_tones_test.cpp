// From an experiment with three tones to a controller, without a model: the default sensor, a robot of which the
// station knows nothing, and the true fluid beside what was measured.
#include <cmath>

#include "control/models/plant_models.hpp"
#include "control/responses/frequency_response.hpp"
#include "control/responses/margins.hpp"
#include "control/tuning/measured_tuning.hpp"
#include "server/analysis/run_recording.hpp"
#include "server/experiments/three_tones_document.hpp"
#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

constexpr double kCrossover_rad_s = 4;

class ThreeTonesExperiment : public ExperimentTest {
 protected:
  void begin_with_default_sensor() {
    sim_robot::SimulatedRobotConfig config;
    config.world.imu.emplace();
    begin(std::move(config));
  }
  // What a job tune_measured measures of the run.
  control::MeasuredPlant measure(const storage::Experiment& experiment) {
    const auto samples = samples_of(experiment.runs.at(0).run.value());
    const auto recorded = analysis::recording_of({samples, {}, {}}, {}, analysis::ChannelChoice::robot);
    EXPECT_TRUE(recorded) << recorded.error().detail;
    const control::Recording& recording = recorded->recording;
    control::ToneRecord record{recording.duty, recording.acceleration_m_s2, recording.dt_s};
    record.from_s = 5;
    return control::measure_three_tones(record, kCrossover_rad_s);
  }
};

TEST_F(ThreeTonesExperiment, MeasuresTheFluidThatTheRobotIsInAndTunesForIt) {
  begin_with_default_sensor();
  const auto id = start(server::experiments::three_tones_document(kCrossover_rad_s, 0.02).dump());
  const storage::Experiment ended = until(id, ExperimentState::done, 120s);
  clock.run_for(2s);
  const control::MeasuredPlant measured = measure(ended);
  ASSERT_EQ(measured.refusal, "");
  const control::FractionalModel& fluid = control::kNonNewtonianModel;  // the simulated robot's, by default
  const control::AxisPoint truth = control::PlantOnAxis{fluid, false}.at(std::log(kCrossover_rad_s));
  const control::MeasuredPoint& at = measured.at_crossover();
  EXPECT_NEAR(at.modulus / std::abs(truth.value), 1, 0.02);
  EXPECT_NEAR((at.phase_rad - truth.phase_rad) * control::kDegPerRad, 0, 2);
  EXPECT_NEAR(measured.phase_fall / -truth.log_slope.imag(), 1, 0.1);
  const control::TuningSpec spec{kCrossover_rad_s, 95, {}, false};
  const control::MeasuredTuning tuned = control::tune_measured(measured, spec);
  ASSERT_TRUE(tuned.controller) << tuned.reason;
  const control::Margins achieved = control::margins({fluid, *tuned.controller, false});
  EXPECT_NEAR(*achieved.phase_margin_deg, spec.phase_margin_deg, 5);
  EXPECT_NEAR(*achieved.gain_crossover_rad_s, kCrossover_rad_s, 0.05 * kCrossover_rad_s);
}

// Tones that are lost in the sensor's noise are never taken for the fluid.
TEST_F(ThreeTonesExperiment, ARobotThatHardlyMovesIsRefused) {
  begin_with_default_sensor();
  const auto id = start(server::experiments::three_tones_document(kCrossover_rad_s, 0.0001).dump());
  const storage::Experiment ended = until(id, ExperimentState::done, 120s);
  clock.run_for(2s);
  EXPECT_NE(measure(ended).refusal, "");
}

}  // namespace
}  // namespace server
