// Adds the electrode's errors and faults to the truth.
#include "sim_robot/world/electrode.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {

void check(const SensorFault& fault) {
  if (!std::isfinite(fault.magnitude)) {
    base::throw_invalid("sensor fault: its magnitude must be finite, is ", fault.magnitude);
  }
  if (fault.kind == SensorFaultKind::noisy && fault.magnitude < 0) {
    base::throw_invalid("sensor fault: noise must be 0 or more, is ", fault.magnitude);
  }
}

void check(const ElectrodeParameters& parameters) {
  if (!(parameters.noise_mv >= 0 && std::isfinite(parameters.noise_mv))) {
    base::throw_invalid("electrode: noise_mv must be 0 or more and finite, is ", parameters.noise_mv);
  }
  if (!std::isfinite(parameters.offset_mv)) base::throw_invalid("electrode: offset_mv is ", parameters.offset_mv);
  if (!std::isfinite(parameters.drift_mv_s)) base::throw_invalid("electrode: drift_mv_s is ", parameters.drift_mv_s);
}

Electrode::Electrode(const ElectrodeParameters& parameters, std::uint64_t seed)
    : parameters_(parameters), noise_(seed) {
  check(parameters);
}

void Electrode::step() { drift_mv_ += parameters_.drift_mv_s * kTickS; }

double Electrode::read(double impedance_mv) {
  if (fault_.kind == SensorFaultKind::missing) return 0;
  if (fault_.kind == SensorFaultKind::stuck && has_read_) return reading_mv_;
  has_read_ = true;
  reading_mv_ = impedance_mv + parameters_.offset_mv + drift_mv_;
  if (parameters_.noise_mv > 0) reading_mv_ += parameters_.noise_mv * noise_.normal();  // (1)
  if (fault_.kind == SensorFaultKind::offset) reading_mv_ += fault_.magnitude;
  if (fault_.kind == SensorFaultKind::noisy) reading_mv_ += fault_.magnitude * noise_.normal();
  return reading_mv_;
}

}  // namespace sim_robot
