// Checks models, and computes the hydrodynamic one.
#include "control/models/plant_models.hpp"

#include <cmath>
#include <numbers>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

using std::numbers::pi;

[[noreturn]] void refuse(const char* what, double value) { base::throw_invalid(what, ' ', value); }

void check_positive(const char* what, double value) {
  if (!(value > 0 && std::isfinite(value))) refuse(what, value);
}

}  // namespace

void check(const FractionalModel& model) {
  if (!std::isfinite(model.kp) || model.kp == 0) refuse("model: kp must be finite and not 0, is", model.kp);
  if (!(model.b1 >= 0 && std::isfinite(model.b1))) refuse("model: b1 must be 0 or positive, is", model.b1);
  check_positive("model: b2 must be positive, is", model.b2);
  check_positive("model: b3 must be positive, is", model.b3);
  if (!(model.beta > 0 && model.beta <= 1)) refuse("model: beta must lie in (0, 1], is", model.beta);
  if (!(model.alpha > model.beta && model.alpha <= 2)) refuse("model: alpha must lie in (beta, 2], is", model.alpha);
  if (!(model.dead_time_s >= 0 && std::isfinite(model.dead_time_s))) {
    refuse("model: dead_time_s must be 0 or positive, is", model.dead_time_s);
  }
}

FractionalModel normalised(const FractionalModel& model) {
  return {model.kp / model.b3, model.b1 / model.b3, model.b2 / model.b3, 1, model.alpha, model.beta, model.dead_time_s};
}

void check(const MotorModel& model) {
  check_positive("motor: gain_rad_s must be positive, is", model.gain_rad_s);
  check_positive("motor: time_constant_s must be positive, is", model.time_constant_s);
}

HydrodynamicModel hydrodynamic_model(const HydrodynamicParameters& p) {
  check(p.motor);
  check_positive("thrust_coefficient must be positive, is", p.thrust_coefficient);
  check_positive("drag_coefficient must be positive, is", p.drag_coefficient);
  check_positive("propeller_diameter_m must be positive, is", p.propeller_diameter_m);
  check_positive("propeller_radius_m must be positive, is", p.propeller_radius_m);
  check_positive("blade_area_m2 must be positive, is", p.blade_area_m2);
  check_positive("fluid_density_kg_m3 must be positive, is", p.fluid_density_kg_m3);
  check_positive("frontal_area_m2 must be positive, is", p.frontal_area_m2);
  check_positive("mass_kg must be positive, is", p.mass_kg);
  check_positive("numerator must be positive, is", p.numerator);
  if (!(p.added_mass_coefficient >= 0 && std::isfinite(p.added_mass_coefficient)))
    refuse("added_mass_coefficient must be 0 or positive, is", p.added_mass_coefficient);
  if (!(p.flow_velocity_m_s >= 0 && std::isfinite(p.flow_velocity_m_s)))
    refuse("flow_velocity_m_s must be 0 or positive, is", p.flow_velocity_m_s);
  check_positive("operating_velocity_m_s must be positive, is", p.operating_velocity_m_s);

  HydrodynamicModel result;
  const double disc_m2 = pi * p.propeller_diameter_m * p.propeller_diameter_m / 4;
  result.total_mass_kg = p.mass_kg + 4.0 / 3 * p.added_mass_coefficient * p.fluid_density_kg_m3 * pi * disc_m2;  // (3)
  const double drag_kg_m = p.fluid_density_kg_m3 * p.drag_coefficient * p.frontal_area_m2;
  result.quadratic_drag_kg_m = drag_kg_m / 2;
  result.linear_drag_kg_s = drag_kg_m * p.flow_velocity_m_s;
  result.damping_kg_s = 2 * p.operating_velocity_m_s * result.quadratic_drag_kg_m + result.linear_drag_kg_s;  // (4)
  const double motor_rate = 1 / p.motor.time_constant_s, drag_rate = result.damping_kg_s / result.total_mass_kg;
  result.model = {p.numerator, 1, motor_rate + drag_rate, motor_rate * drag_rate, 2, 1};  // (5)
  result.derived_numerator = p.motor.gain_rad_s * p.thrust_coefficient * p.fluid_density_kg_m3 * p.blade_area_m2 *
                             p.propeller_radius_m * p.propeller_radius_m * motor_rate / result.total_mass_kg;  // (6)
  return result;
}

}  // namespace control
