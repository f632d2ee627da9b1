// What is known of a fluid after a run that was interrupted ten times.
#include <array>
#include <cmath>
#include <cstdlib>
#include <random>

#include "control/identification/identify.hpp"
#include "server/analysis/run_recording.hpp"
#include "tests/system/interrupted_fixture.hpp"

namespace server {
namespace {

// With the default sensor, as a laboratory has it: the acceleration is fitted.
class InterruptedIdentificationTest : public InterruptedTest {
 protected:
  static sim_robot::SimulatedRobotConfig with_sensor() {
    sim_robot::SimulatedRobotConfig config;
    config.world.imu.emplace();
    return config;
  }
  InterruptedIdentificationTest() : InterruptedTest{with_sensor()} {}

  static int seeds() {
    const char* given = std::getenv("RHEONAUT_OUTAGE_SEEDS");
    return given == nullptr ? 1 : std::stoi(given);
  }
  void ten_outages(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> between_ms(1000, 18'000), away_ms(200, 3000);
    for (int outage = 0; outage < 10; ++outage) {
      clock.run_for(std::chrono::milliseconds(between_ms(random)));
      if (random() % 2 == 0) {
        lose_link(std::chrono::milliseconds(away_ms(random)));
      } else {
        robot->stall(true);
        clock.run_for(std::chrono::milliseconds(away_ms(random)));
        robot->stall(false);
      }
    }
  }
  storage::Experiment ended(storage::ExperimentId id) {
    clock.run_until([&] { return storage::has_ended(view(id).experiment.state); }, 1000s);
    return view(id).experiment;
  }
  storage::ExperimentId undisturbed_one() {
    const auto id = start(shipped("identification_set"));
    EXPECT_EQ(ended(id).state, ExperimentState::done);
    return id;
  }
  static std::array<double, control::kParameters> values_of(const control::Fit& fit) {
    return {fit.model.kp, fit.model.b1, fit.model.b2, fit.model.alpha, fit.model.beta};
  }
  control::Fit fit_of(storage::ExperimentId id) {
    const auto recorded = analysis::recording_of({samples_of_first_run(id), {}, run_of(id).interrupted}, {});
    EXPECT_TRUE(recorded) << recorded.error().detail;
    control::IdentificationOptions options;
    options.structure = control::Structure::fractional;
    options.further_starts = 0;
    options.time_limit_s = 1e6;
    return control::identify(recorded->recording, options).best;
  }
};

// The same model as without them, and as well known.
TEST_F(InterruptedIdentificationTest, SurvivesTenOutages) {
  const control::Fit undisturbed = fit_of(undisturbed_one());
  int done = 0, parameters = 0, within = 0, as_well_known = 0;
  for (int seed = 1; seed <= seeds(); ++seed) {
    const auto id = start(shipped("identification_set"));
    ten_outages(static_cast<unsigned>(seed));
    const storage::Experiment experiment = ended(id);
    if (experiment.state != ExperimentState::done) {
      std::printf("seed %d: %s: %s\n", seed, experiment.reason.c_str(), experiment.detail.c_str());
      continue;
    }
    ++done;
    const control::Fit fit = fit_of(id);
    const auto values = values_of(fit), wanted = values_of(undisturbed);
    for (std::size_t i = 0; i < control::kParameters; ++i) {
      const double sigma = *fit.one_sigma[i], wanted_sigma = *undisturbed.one_sigma[i];
      const double off = (values[i] - wanted[i]) / std::hypot(sigma, wanted_sigma);
      ++parameters;
      within += std::abs(off) <= 3 ? 1 : 0;
      as_well_known += sigma <= 1.5 * wanted_sigma ? 1 : 0;
      std::printf("seed %d: %s off by %.2f sigma, sigma %.2f times\n", seed, control::kParameterNames[i], off,
                  sigma / wanted_sigma);
    }
  }
  EXPECT_GE(done * 20, seeds() * 19);
  EXPECT_GE(within * 20, parameters * 19);
  EXPECT_EQ(as_well_known, parameters);
}

}  // namespace
}  // namespace server
