// Integrates the nonlinear model, and chooses between the models.
#include "sim_robot/world/plant.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

using Motion = std::variant<control::ModalPlant, NonlinearPlant, ShearThinningPlant>;

control::FractionalModel linear_model(const PlantParameters& parameters) {
  control::FractionalModel model = parameters.model;
  model.dead_time_s += parameters.dead_time_s;
  return model;
}

Motion motion_of(const PlantParameters& parameters, double dt_s) {
  if (parameters.kind == PlantKind::linear) return control::ModalPlant{linear_model(parameters), dt_s};
  if (parameters.kind == PlantKind::shear_thinning) return ShearThinningPlant{parameters.shear_thinning, dt_s};
  return NonlinearPlant{parameters.hydrodynamics, dt_s};
}

}  // namespace

void check(const PlantParameters& parameters) {
  const bool is_linear = parameters.kind == PlantKind::linear;
  const double dead_time_s = parameters.dead_time_s + (is_linear ? parameters.model.dead_time_s : 0);
  if (!(parameters.dead_time_s >= 0 && dead_time_s <= 10))
    base::throw_invalid("dead_time_s is ", dead_time_s, ", allowed is 0 to 10");
  if (is_linear) return control::check(parameters.model);
  if (parameters.kind == PlantKind::shear_thinning) return check(parameters.shear_thinning);
  control::hydrodynamic_model(parameters.hydrodynamics);  // refuses what cannot be
}

PlantParameters fluid(const std::string& name) {
  if (name == "non_newtonian") return {.model = control::kNonNewtonianModel};
  if (name == "water") return {.model = control::kNewtonianModel};
  if (name == "water_nonlinear") return {.kind = PlantKind::nonlinear};
  if (name == "shear_thinning") return {.kind = PlantKind::shear_thinning};
  base::throw_invalid("there is no fluid '", name,
                      "'; there are non_newtonian, water, water_nonlinear and shear_thinning");
}

NonlinearPlant::NonlinearPlant(const control::HydrodynamicParameters& p, double dt_s, int steps)
    : steps_(steps),
      step_s_(dt_s / steps),
      gain_rad_s_(p.motor.gain_rad_s),
      half_decay_(std::exp(-step_s_ / 2 / p.motor.time_constant_s)) {
  const control::HydrodynamicModel model = control::hydrodynamic_model(p);
  const double radius_m = p.propeller_radius_m;
  thrust_ = p.thrust_coefficient * p.fluid_density_kg_m3 * p.blade_area_m2 * radius_m * radius_m / model.total_mass_kg;
  quadratic_drag_ = model.quadratic_drag_kg_m / model.total_mass_kg;
  linear_drag_ = model.linear_drag_kg_s / model.total_mass_kg;
}

double NonlinearPlant::slope(double velocity_m_s, double rate_rad_s) const {
  return thrust_ * rate_rad_s * std::abs(rate_rad_s) -
         (quadratic_drag_ * std::abs(velocity_m_s) + linear_drag_) * velocity_m_s;
}

void NonlinearPlant::step(double duty) {
  const double wanted_rad_s = gain_rad_s_ * duty, h = step_s_;
  for (int i = 0; i < steps_; ++i) {
    const double start = rate_rad_s_;
    const double middle = wanted_rad_s + (start - wanted_rad_s) * half_decay_;  // (1)
    const double end = wanted_rad_s + (middle - wanted_rad_s) * half_decay_;
    const double v = velocity_m_s_;
    const double k1 = slope(v, start);  // (2)
    const double k2 = slope(v + h / 2 * k1, middle);
    const double k3 = slope(v + h / 2 * k2, middle);
    const double k4 = slope(v + h * k3, end);
    position_m_ += h * (v + h / 6 * (k1 + k2 + k3));  // (3)
    velocity_m_s_ += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    rate_rad_s_ = end;
  }
}

Plant::Plant(const PlantParameters& parameters, double dt_s)
    : motion_(motion_of(parameters, dt_s)),
      delay_(parameters.kind == PlantKind::linear ? 0 : dt_s * std::round(parameters.dead_time_s / dt_s), dt_s) {}

double Plant::delayed(double duty) {
  return delay_.push(duty).later;  // the linear one holds it back itself
}

void Plant::step(double duty) {
  std::visit(
      [this, due = delayed(duty)](auto& motion) {
        motion.step(due);
        position_m_ = motion.position_m();
        velocity_m_s_ = motion.velocity_m_s();
        acceleration_m_s2_ = motion.acceleration_m_s2();
      },
      motion_);
}

}  // namespace sim_robot
