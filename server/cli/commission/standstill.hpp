// What is found while the robot lies still: its versions, the way of an emergency stop, the accelerometer's noise, the
// electrode. Facts in, a finding out: nothing here asks a robot.
//
// Symbols: sd, standard deviation of a sample about the mean; n, number of samples; all units are in the names.
// Errors: none; facts that are missing give a finding that says so.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "server/cli/commission/finding.hpp"

namespace server::cli {

struct VersionFacts {
  std::string firmware, station, program;
  std::string reset_cause;   // of the boot that runs
  long imu_calibration = 0;  // 0 to 3
  bool has_status = false;   // a Status came
};

// The firmware's version as it ends, such as "sim-0.9.0": that of the station.
StepFinding judge_versions(const VersionFacts& facts);

struct StopFacts {
  std::size_t asked = 0;                // stops
  std::vector<double> confirmed_ms;     // of those that the robot itself confirmed, as the station measured them
  std::string not_confirmed;            // or not reset: why, of the one that ended the trial; empty: none
  std::optional<double> round_trip_ms;  // of the station's last probe of the same way
};

// SAFETY: anything but a confirmation of each stop fails, and the motor must not run then.
StepFinding judge_stops(const StopFacts& facts);
double worst_stop_ms(const StopFacts& facts);  // 0 without a stop

struct RestFacts {
  std::vector<double> acceleration_m_s2;  // as recorded: the reading less the robot's own estimate of its bias
  std::vector<double> impedance_mv;
  bool has_sensor_fault = false;          // a sample was made with one
  double expected_noise_m_s2 = 0.013;     // the robot's parameter acceleration_noise_m_s2
  double nominal_mv = 175, band_mv = 20;  // its parameters impedance_nominal_mv and impedance_band_mv
};

double mean_of(const std::vector<double>& values);
double sd_of(const std::vector<double>& values);

StepFinding judge_imu_noise(const RestFacts& facts);
StepFinding judge_electrode(const RestFacts& facts);

}  // namespace server::cli
