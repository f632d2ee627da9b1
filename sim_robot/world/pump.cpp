// Reads the profile from a table and lets the walls smooth it.
#include "sim_robot/world/pump.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <numbers>
#include <ostream>

#include "base/invalid_argument.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

constexpr double kRawMean = 0.2123487689562026;
constexpr double kSystoleEnd = 0.436, kSystoleShift = 0.0320472, kPeakRaw = 0.5, kRestRaw = 0.1;
constexpr std::size_t kTableTicks = 600;  // 7 periods
constexpr double kSettledTimeConstants = 20;

std::span<const double> profile_table() {
  static const auto kTable = [] {
    std::array<double, kTableTicks> table{};
    for (std::size_t k = 0; k < kTableTicks; ++k) table[k] = pump_profile(kTickS * static_cast<double>(k));
    return table;
  }();
  return kTable;
}

}  // namespace

void check(const PumpParameters& parameters) {
  const auto refuse = [](const char* name, const char* allowed, double value) {
    base::throw_invalid("pump: ", name, " must be ", allowed, ", is ", value);
  };
  if (!(std::abs(parameters.mean_flow_m3_s) <= kMostFlowM3S)) {
    refuse("mean_flow_m3_s", "in [-0.03, 0.03] (30 L/s)", parameters.mean_flow_m3_s);
  }
  if (!std::isfinite(parameters.starts_at_s)) refuse("starts_at_s", "finite", parameters.starts_at_s);
  if (!(parameters.ramp_s >= 0 && parameters.ramp_s <= 3600)) refuse("ramp_s", "in [0, 3600]", parameters.ramp_s);
  if (!(parameters.compliance_s >= 0 && parameters.compliance_s <= 10)) {
    refuse("compliance_s", "in [0, 10]", parameters.compliance_s);
  }
}

double pump_profile(double time_s) {
  const double periods = 7 * time_s / 6, phase = periods - std::floor(periods);
  const double raw =
      phase <= kSystoleEnd ? kPeakRaw * std::sin(2 * std::numbers::pi * (phase + kSystoleShift)) : kRestRaw;
  return raw / kRawMean;  // (1)
}

void write_flow_csv(std::ostream& out, double mean_flow_m3_s, int rows) {
  if (rows < 2) base::throw_invalid("flow CSV: needs at least 2 rows, not ", rows);
  out << "t_s,flow_m3_s\n" << std::setprecision(9);
  for (int row = 0; row < rows; ++row) {
    const double time_s = kPumpPeriodS * row / rows;
    out << time_s << ',' << mean_flow_m3_s * pump_profile(time_s) << '\n';
  }
}

Pump::Pump(const PumpParameters& parameters)
    : profile_(profile_table()),
      per_ramp_tick_(parameters.ramp_s > 0 ? kTickS / parameters.ramp_s : 2),
      decay_(std::exp(-kTickS / parameters.compliance_s)),
      late_share_(1 - parameters.compliance_s / kTickS * (1 - decay_)),
      kind_(parameters.kind),
      to_(flow_of(parameters.kind, parameters.mean_flow_m3_s)) {
  check(parameters);
  if (parameters.starts_at_s >= 0) {
    starts_in_ticks_ = parameters.starts_at_s / kTickS;
    ramp_ = 0;
    return;
  }
  // Up to time 0 as if it had always been on.
  const double settling_ticks = std::ceil(kSettledTimeConstants * parameters.compliance_s / kTickS);
  tick_ = kTableTicks - 1 - static_cast<std::size_t>(settling_ticks) % kTableTicks;
  inflow_m3_s_ = flow_m3_s_ = to_.pulse_m3_s * profile_[tick_] + to_.constant_m3_s;
  for (double k = 0; k <= settling_ticks; ++k) step();
}

Pump::Flow Pump::flow_of(PumpKind kind, double mean_flow_m3_s) {
  return kind == PumpKind::constant ? Flow{0, mean_flow_m3_s} : Flow{mean_flow_m3_s, 0};
}

Pump::Flow Pump::driven() const {
  return {std::lerp(from_.pulse_m3_s, to_.pulse_m3_s, ramp_), std::lerp(from_.constant_m3_s, to_.constant_m3_s, ramp_)};
}

double Pump::mean_flow_m3_s() const {
  const Flow now = driven();
  return now.pulse_m3_s + now.constant_m3_s;
}

void Pump::set_mean_flow_m3_s(double flow_m3_s) { set_flow(kind_, flow_m3_s); }

void Pump::set_flow(PumpKind kind, double mean_flow_m3_s) {
  check(PumpParameters{.kind = kind, .mean_flow_m3_s = mean_flow_m3_s});
  from_ = driven();
  to_ = flow_of(kind, mean_flow_m3_s);
  kind_ = kind;
  ramp_ = starts_in_ticks_ = 0;
}

void Pump::step() {
  tick_ = tick_ + 1 < kTableTicks ? tick_ + 1 : 0;
  if (starts_in_ticks_ >= 1) {
    starts_in_ticks_ -= 1;
  } else {
    ramp_ = std::min(1.0, ramp_ + per_ramp_tick_ * (1 - starts_in_ticks_));
    starts_in_ticks_ = 0;
  }
  const Flow now = driven();
  take_up(now.pulse_m3_s * profile_[tick_] + now.constant_m3_s);  // (2)
}

// (3), exact for an inflow that is linear between two ticks.
void Pump::take_up(double inflow_m3_s) {
  flow_m3_s_ = decay_ * flow_m3_s_ + (1 - decay_) * inflow_m3_s_ + late_share_ * (inflow_m3_s - inflow_m3_s_);
  inflow_m3_s_ = inflow_m3_s;
}

}  // namespace sim_robot
