// Detects glucose, which lowers the impedance, and reports when it has mixed.
//
//   glucose     5 readings in a row differ from the nominal one by more than `band_mv`
//   mixed       50 readings in a row, taken at the position to hold, are within `exit_band_mv` of it
//   armed again after a detection: 50 readings in a row within `band_mv`
// Appendix B of the paper: 175 mV without glucose, 120 mV in it.
#pragma once

namespace robot_fw {

struct ImpedanceRules {
  float nominal_mv = 175;
  float band_mv = 20;
  float exit_band_mv = 15;
};

class ImpedanceMonitor {
 public:
  // Once per tick. `usable`: the electrode's reading lies within its range; `in_place`: the robot is at the position
  // to hold. True in the tick of a detection.
  bool step(float impedance_mv, bool usable, bool in_place, const ImpedanceRules& rules);
  bool mixed() const;
  void arm() { armed_ = true; }

 private:
  bool armed_ = true;
  int outside_ = 0, inside_ = 0, mixed_ = 0;  // in a row
};

}  // namespace robot_fw
