// The battery: its voltage falls with use, and sags while the motor runs.
//
//   V = V_open - sag · |u|                                               (1)
//   V_open' = -(idle + motor · |u|)                                      (2)   never below 0
// The motor's effect is in proportion to V; at nominal_mv it is that of the plant's model.
// Errors: check() throws std::invalid_argument quoting the bad value.
#pragma once

namespace sim_robot {

struct BatteryParameters {
  double open_circuit_mv = 3000;    // when the robot boots; a fresh CR123A
  double nominal_mv = 3000;         // at which the plant's model holds
  double sag_mv = 0;                // at duty 1: the internal resistance times the motor's current
  double idle_discharge_mv_h = 0;   // with the motor off
  double motor_discharge_mv_h = 0;  // at duty 1, on top of that
};

// A CR123A: 1500 mAh from 3.0 V to 2.5 V, 0.4 Ω; 80 mA for the board and 0.7 A for the motor. Assumed values.
constexpr BatteryParameters kCr123a{3000, 3000, 280, 27, 233};

void check(const BatteryParameters& parameters);

class Battery {
 public:
  explicit Battery(const BatteryParameters& parameters);

  // One tick under the motor's duty.
  void step(double duty);

  double supply_mv() const { return supply_mv_; }
  double supply_ratio() const { return supply_mv_ * per_nominal_mv_; }

 private:
  double open_circuit_mv_;
  double sag_mv_;
  double per_nominal_mv_;
  double idle_mv_, motor_mv_;  // lost in a tick
  double supply_mv_;
};

}  // namespace sim_robot
