// The readings of a DropSens DS550 electrode from the fluid's impedance.
//
//   reading = Z + offset + drift · t + noise                                                        (1)   mV
// Offset and drift as given; the noise is white. No data sheet gives these numbers: kDs550 is assumed.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <cstdint>

#include "sim_robot/world/noise.hpp"
#include "sim_robot/world/sensor_fault.hpp"

namespace sim_robot {

struct ElectrodeParameters {
  double noise_mv = 0;  // sd of a reading
  double offset_mv = 0;
  double drift_mv_s = 0;
};

constexpr ElectrodeParameters kDs550{1, 2, 0.01};

void check(const ElectrodeParameters& parameters);

class Electrode {
 public:
  Electrode(const ElectrodeParameters& parameters, std::uint64_t seed);

  void step();  // one tick
  void set_fault(const SensorFault& fault) { fault_ = fault; }

  // 0 when it is missing, as on the robot.
  double read(double impedance_mv);

 private:
  ElectrodeParameters parameters_;
  Noise noise_;
  SensorFault fault_;
  double drift_mv_ = 0;
  double reading_mv_ = 0;
  bool has_read_ = false;
};

}  // namespace sim_robot
