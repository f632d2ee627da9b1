// Drives the robot tick by tick through its own link, as a station does, and fits what comes back.
#include "tests/sim_robot/identification_trial.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "control/responses/time_response.hpp"
#include "sim_robot/lab/scenario_run.hpp"
#include "sim_robot/lab/station_peer.hpp"
#include "sim_robot/world/imu.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

constexpr int kRestTicks = 50, kTicksToTell = 2 * robot_fw::kModelSections;
constexpr std::size_t kTicksPerCommand = 25;  // a duty ends 0.5 s after its command

PlantParameters plant_of(const IdentificationTrial& trial) {
  return {.kind = trial.kind, .model = trial.fluid, .dead_time_s = trial.dead_time_s};
}

SimulatedRobotConfig config_of(const IdentificationTrial& trial, std::uint64_t seed) {
  SimulatedRobotConfig config;
  config.boot_id = 1;
  config.world.plant = plant_of(trial);
  config.world.imu.emplace();
  config.world.seed = seed;
  return config;
}

void tell_water(StationPeer& station) {
  const auto& water = robot_fw::kWaterVelocityModel;
  for (std::size_t i = 0; i < robot_fw::kModelSections; ++i) {
    const std::string number = std::to_string(i + 1);
    station.send(set_parameter(("model_gain_" + number + "_m_s").c_str(), water.gain_m_s[i]));
    station.step();
    station.send(set_parameter(("model_time_constant_" + number + "_s").c_str(), water.time_constant_s[i]));
    station.step();
  }
}

// Of a reading: noise and quantum, both white.
double noise_m_s2() {
  const ImuParameters imu;
  const double quantum = 1 / Imu::kCountsPerMS2;
  return std::sqrt(imu.noise_m_s2_rthz * imu.noise_m_s2_rthz * imu.bandwidth_hz + quantum * quantum / 12);
}

std::array<double, control::kParameters> values(const control::FractionalModel& m) {
  return {m.kp, m.b1, m.b2, m.alpha, m.beta};
}

}  // namespace

control::IdentificationOptions one_start_options() {
  control::IdentificationOptions options;
  options.structure = control::Structure::fractional;
  options.further_starts = 0;
  options.time_limit_s = 1e6;
  return options;
}

std::vector<double> study_duty() { return control::prbs_duty(0.6, 0.5, 60, SimulatedRobot::kPeriodS); }

control::Recording record(const IdentificationTrial& trial, std::uint64_t seed) {
  SimulatedRobot robot{config_of(trial, seed)};
  StationPeer station{robot};
  station.connect();
  if (trial.believes_in_water) {
    tell_water(station);
  } else {
    station.run(kTicksToTell);  // so that the sensor's noise is the same
  }
  station.run(kRestTicks);
  const std::uint64_t begins = station.samples.rbegin()->first + 1;
  for (std::size_t k = 0; k < trial.duty.size(); k += kTicksPerCommand) {
    station.send(set_duty(static_cast<float>(trial.duty[k])));
    station.run(static_cast<int>(std::min(kTicksPerCommand, trial.duty.size() - k)));
  }
  control::Recording recording;
  recording.dt_s = SimulatedRobot::kPeriodS;
  for (auto sample = station.samples.lower_bound(begins); sample != station.samples.end(); ++sample) {
    recording.duty.push_back(static_cast<double>(sample->second.duty));
    recording.acceleration_m_s2.push_back(static_cast<double>(sample->second.acceleration_m_s2));
  }
  return recording;
}

control::Recording record_played(const std::string& file, std::uint64_t seed,
                                 const std::optional<control::FractionalModel>& fluid) {
  Scenario scenario = load_scenario(file);
  scenario.robot.boot_id = 1;
  scenario.robot.world.seed = seed;
  if (fluid) scenario.robot.world.plant.model = *fluid;
  ScenarioRun run{scenario};
  run.run();
  control::Recording recording;
  recording.dt_s = SimulatedRobot::kPeriodS;
  for (const auto& [seq, sample] : run.station().samples) {
    recording.duty.push_back(static_cast<double>(sample.duty));
    recording.acceleration_m_s2.push_back(static_cast<double>(sample.acceleration_m_s2));
  }
  return recording;
}

control::Recording record_position(const IdentificationTrial& trial, double sd_m, std::uint64_t seed) {
  Plant plant{plant_of(trial), kTickS};
  std::mt19937_64 random{seed};
  std::normal_distribution noise{0.0, sd_m};
  control::Recording recording;
  recording.dt_s = kTickS;
  recording.duty = trial.duty;
  for (const double duty : trial.duty) {
    recording.position_m.push_back(plant.position_m() + noise(random));
    plant.step(duty);
  }
  return recording;
}

std::vector<double> steps_duty() {
  std::vector<double> duty;
  for (const double step : {0.2, 0.5, 0.8}) {
    duty.insert(duty.end(), 500, step);
    duty.insert(duty.end(), 500, 0.0);
  }
  return duty;
}

std::vector<double> levels_duty(std::uint64_t seed) {
  constexpr std::array<double, 6> kLevels{-0.8, -0.5, -0.2, 0.2, 0.5, 0.8};
  std::mt19937_64 random{seed};
  std::vector<double> duty;
  for (int bit = 0; bit < 120; ++bit) duty.insert(duty.end(), 50, kLevels[random() % kLevels.size()]);
  return duty;
}

double worst_response_error(const control::FractionalModel& model, const control::FractionalModel& truth) {
  const std::vector<double> time_s{0.1, 1, 5};
  const auto found = control::step_response(model, 1, time_s).velocity_m_s;
  const auto expected = control::step_response(truth, 1, time_s).velocity_m_s;
  double worst = 0;
  for (std::size_t i = 0; i < time_s.size(); ++i) worst = std::max(worst, std::abs(found[i] / expected[i] - 1));
  return worst;
}

TrialFit fit_of(const control::Recording& recording, const control::FractionalModel& fluid) {
  const control::IdentificationOptions options = one_start_options();
  TrialFit result{control::identify(recording, options).best};
  result.worst_response = worst_response_error(result.fit.model, fluid);
  control::PlannedExperiment experiment;
  experiment.dt_s = recording.dt_s;
  experiment.duty = recording.duty;
  experiment.acceleration_sd_m_s2 = noise_m_s2();
  const auto bound = control::expected_uncertainty(fluid, experiment);
  const auto found = values(result.fit.model), truth = values(fluid);
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    const double sigma = result.fit.one_sigma[i].value_or(0);
    result.worst_sigmas = std::max(result.worst_sigmas, std::abs(found[i] - truth[i]) / sigma);
    result.worst_sigma_by_bound = std::max(result.worst_sigma_by_bound, sigma / bound.one_sigma[i].value());
  }
  return result;
}

}  // namespace sim_robot
