// Drives a simulated robot through the experiment and measures what its telemetry says.
#include "sim_robot/lab/experiment.hpp"

#include <cmath>

#include "sim_robot/lab/station_peer.hpp"

namespace sim_robot {
namespace {

constexpr double kSetpointM = 0.1, kDisturbanceM = -0.05, kBandM = 0.02 * kSetpointM;
constexpr double kDisturbedAtS = 20, kEndS = 40;

int ticks(double duration_s) { return static_cast<int>(std::lround(duration_s / SimulatedRobot::kPeriodS)); }

}  // namespace

ExperimentResult run_experiment(const SimulatedRobotConfig& config) {
  SimulatedRobot robot{config};
  StationPeer station{robot};
  station.welcome.samples_per_frame = 1;  // so that the last sample is sent in its own tick
  station.connect();
  station.send(set_auto(static_cast<float>(kSetpointM)));
  station.run(ticks(kDisturbedAtS));
  station.send(inject_disturbance(static_cast<float>(kDisturbanceM)));
  station.run(ticks(kEndS - kDisturbedAtS) + 1);  // the sample at 40 s too
  station.disconnect();

  ExperimentResult result;
  for (const auto& [seq, sample] : station.samples) {
    result.time_s.push_back(static_cast<double>(sample.robot_time_us) * 1e-6);
    result.position_m.push_back(static_cast<double>(sample.position_m));
    result.duty.push_back(static_cast<double>(sample.duty));
  }
  result.step = control::measure_step(result.time_s, result.position_m, {0, kDisturbedAtS, 0, kSetpointM, kBandM});
  result.disturbance = control::measure_step(result.time_s, result.position_m,
                                             {kDisturbedAtS, kEndS, kSetpointM + kDisturbanceM, kSetpointM, kBandM});
  return result;
}

}  // namespace sim_robot
