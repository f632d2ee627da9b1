// The pump: the flow rate that it drives through the vessel, constant or 70 times a minute.
//
//   q(t) = r(p)/r̄,  p = frac(7 t/6),  r = 0.5 sin(2π (p + 0.0320472)) for p ≤ 0.436, else 0.1       (1)   mean 1
//   Q_pump = Q_pulse(t) q(t) + Q_constant(t),  Q_mean = Q_pulse + Q_constant                        (2)   m³/s
//   τ Q' = Q_pump - Q                                                                               (3)   compliance
//
// (1) is a pulse that public CFD codes use for blood, at the paper's 70 bpm; the paper's own reference for its profile
// could not be found. (3): the elastic walls take up a share of the pulse and give it back, as one compliance C behind
// the resistance R of the tubes, τ = R C; the mean is not changed. 7 periods are 600 ticks, so a table holds (1).
// Of (2) only the one that `kind` names is not 0, but for the ramp from one kind to the other.
// Default of τ: thin walls of 0.9 mm, 20 MPa (assumed), 1.5 m of each tube, 0.085 Pa s: 19 ms.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <span>

namespace sim_robot {

enum class PumpKind : std::uint8_t { pulse_70_bpm, constant };

constexpr double kMostFlowM3S = 0.03;  // 1.5 m/s in the large tube

struct PumpParameters {
  PumpKind kind = PumpKind::pulse_70_bpm;
  double mean_flow_m3_s = 0;   // negative: backwards
  double starts_at_s = -1;     // time of the run; before 0 it has been on for long
  double ramp_s = 1;           // of each change of the mean flow
  double compliance_s = 0.02;  // τ; 0: rigid walls; at most 10
};

void check(const PumpParameters& parameters);

constexpr double kPumpPeriodS = 6.0 / 7;
constexpr double kPaperFlowM3S = 0.000817;  // 0.1 m/s in the small tube, 0.0406 m/s in the large one; assumed

double pump_profile(double time_s);  // (1)

// One period for a pump controller: columns t_s and flow_m3_s, `rows` rows equally spaced from 0 on. It is the pulse
// of (2), what the pump is to do; the walls are then real.
void write_flow_csv(std::ostream& out, double mean_flow_m3_s, int rows = 120);

class Pump {
 public:
  explicit Pump(const PumpParameters& parameters);

  void step();  // one tick

  // From now on, over the ramp; the kind stays.
  void set_mean_flow_m3_s(double flow_m3_s);
  void set_flow(PumpKind kind, double mean_flow_m3_s);  // the same with another kind

  double flow_m3_s() const { return flow_m3_s_; }  // Q
  double mean_flow_m3_s() const;                   // Q_mean

 private:
  // The two terms of (2).
  struct Flow {
    double pulse_m3_s = 0, constant_m3_s = 0;
  };
  static Flow flow_of(PumpKind kind, double mean_flow_m3_s);
  Flow driven() const;  // now, on the ramp
  void take_up(double inflow_m3_s);

  std::span<const double> profile_;  // (1) at the ticks of 7 periods
  double per_ramp_tick_;
  double decay_, late_share_;  // e^{-dt/τ}, and 1 - (τ/dt)(1 - e^{-dt/τ})
  PumpKind kind_;
  Flow from_, to_;
  double ramp_ = 1;  // how far from one to the other
  double starts_in_ticks_ = 0;
  std::size_t tick_ = 0;  // within 7 periods
  double inflow_m3_s_ = 0, flow_m3_s_ = 0;
};

}  // namespace sim_robot
