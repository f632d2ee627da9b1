// The vessel of the paper's Section 2.1: two tubes in a row with a reservoir at each outer end, and the pump.
//
//   | reservoir |   large tube   |   small tube   | reservoir |
//   u(x, t) = Q(t) · mean of 1/A over the robot's length, centred at x                              (1)
//
// Q is the same in every cross-section; its velocity is Q/A. At a junction the robot passes from one velocity to the
// other while its length does. The flow is taken as flat across a tube (Womersley number 15 to 24).
// Positions are the robot's: 0 is where it boots. Beyond the reservoirs' outer ends there is a wall.
// Lengths and reservoirs are assumed, the paper gives the tubes' diameters alone.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <array>

#include "sim_robot/world/pump.hpp"

namespace sim_robot {

struct VesselParameters {
  double large_diameter_m = 0.160;
  double small_diameter_m = 0.102;
  double large_length_m = 1.5;
  double small_length_m = 1.5;
  double reservoir_diameter_m = 0.25;
  double reservoir_length_m = 0.3;
  double junction_m = 1.4;          // where the tubes meet
  bool is_large_tube_first = true;  // forwards: from the large tube into the small one
  double body_length_m = 0.09;      // of the robot
  PumpParameters pump{};
};

void check(const VesselParameters& parameters);

double tube_area_m2(double diameter_m);

class Vessel {
 public:
  explicit Vessel(const VesselParameters& parameters);

  void step() { pump_.step(); }  // one tick
  void set_mean_flow_m3_s(double flow_m3_s) { pump_.set_mean_flow_m3_s(flow_m3_s); }
  void set_flow(PumpKind kind, double mean_flow_m3_s) { pump_.set_flow(kind, mean_flow_m3_s); }

  const Pump& pump() const { return pump_; }
  double velocity_m_s(double position_m) const;  // (1)
  // Cross-section of the tube that has this place; a reservoir belongs to the tube beside it.
  double tube_area_m2(double position_m) const;

  // How far the robot can go either way.
  double first_m() const { return first_m_; }
  double last_m() const { return last_m_; }

 private:
  struct Stretch {
    double start_m, length_m;
    double per_area_m2;  // 1/A
  };
  double passed_per_area(double position_m) const;

  Pump pump_;
  std::array<Stretch, 4> stretches_;  // along the vessel, without holes
  double body_length_m_;
  double first_m_, last_m_;
};

}  // namespace sim_robot
