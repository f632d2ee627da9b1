// Drives a simulated robot through the experiment and measures what its telemetry says.
#include "sim_robot/experiment.hpp"

#include "sim_robot/station_peer.hpp"

namespace sim_robot {
namespace {

constexpr double kSetpoint_m = 0.1, kDisturbance_m = -0.05, kBand_m = 0.02 * kSetpoint_m;
constexpr double kDisturbedAt_s = 20, kEnd_s = 40;

int ticks(double duration_s) { return static_cast<int>(duration_s / SimulatedRobot::kPeriod_s + 0.5); }

}  // namespace

ExperimentResult run_experiment(const SimulatedRobotConfig& config) {
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.welcome.samples_per_frame = 1;  // so that the last sample is sent in its own tick
  station.connect();
  station.send(set_auto(static_cast<float>(kSetpoint_m)));
  station.run(ticks(kDisturbedAt_s));
  station.send(inject_disturbance(static_cast<float>(kDisturbance_m)));
  station.run(ticks(kEnd_s - kDisturbedAt_s) + 1);  // the sample at 40 s too
  station.disconnect();

  ExperimentResult result;
  for (const auto& [seq, sample] : station.samples) {
    result.time_s.push_back(static_cast<double>(sample.robot_time_us) * 1e-6);
    result.position_m.push_back(static_cast<double>(sample.position_m));
    result.duty.push_back(static_cast<double>(sample.duty));
  }
  result.step = control::measure_step(result.time_s, result.position_m, {0, kDisturbedAt_s, 0, kSetpoint_m, kBand_m});
  result.disturbance = control::measure_step(
      result.time_s, result.position_m, {kDisturbedAt_s, kEnd_s, kSetpoint_m + kDisturbance_m, kSetpoint_m, kBand_m});
  return result;
}

}  // namespace sim_robot
