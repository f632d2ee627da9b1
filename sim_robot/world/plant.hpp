// The body in the fluid: what the motor's duty makes of position, velocity and acceleration, relative to the fluid.
//
// Linear, any model of control::FractionalModel, exact between ticks; one that thins under shear
// (shear_thinning_plant.hpp); or the nonlinear one of the paper's Section 3.1:
//   Tm ω' = km u - ω                                                     (1)   (17): the propeller
//   M v' = Ct ρ A r² ω|ω| - X|u|u v|v| - Xu v                            (2)   (1), (13) to (16); M with added mass
//   x' = v                                                               (3)
// with the values of control::HydrodynamicParameters. Duty backwards turns the thrust around. (28) is (2) linearised,
// with an empirical gain: see docs/simulator.md for how far the two are apart.
// Each may answer the duty a dead time late: the linear one exactly, the others in whole ticks.
// Accuracy: (1) exact, (2) and (3) by Runge-Kutta of 4th order in 4 steps a tick: within 1e-5 m/s of 100 times as many
//           steps, held by plant_test.cpp.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <string>
#include <variant>

#include "control/models/delay_line.hpp"
#include "control/models/modal_plant.hpp"
#include "sim_robot/world/shear_thinning_plant.hpp"

namespace sim_robot {

enum class PlantKind { linear, nonlinear, shear_thinning };

struct PlantParameters {
  PlantKind kind = PlantKind::linear;
  control::FractionalModel model = control::kNonNewtonianModel;  // of the linear one
  control::HydrodynamicParameters hydrodynamics{};               // of the nonlinear one
  ShearThinningParameters shear_thinning{};                      // of the one that thins
  double dead_time_s = 0;  // from the duty to its first effect, beside the model's own; at most 10
};

void check(const PlantParameters& parameters);

// The fluids by name: of the paper `non_newtonian` (fabric softener, (29)), `water` ((28)), `water_nonlinear` (2); and
// `shear_thinning`.
// Throws std::invalid_argument naming those that there are.
PlantParameters fluid(const std::string& name);

class NonlinearPlant {
 public:
  NonlinearPlant(const control::HydrodynamicParameters& parameters, double dt_s, int steps = 4);

  void step(double duty);

  double position_m() const { return position_m_; }
  double velocity_m_s() const { return velocity_m_s_; }
  double acceleration_m_s2() const { return slope(velocity_m_s_, rate_rad_s_); }

 private:
  double slope(double velocity_m_s, double rate_rad_s) const;  // (2)

  int steps_;
  double step_s_;
  double thrust_, quadratic_drag_, linear_drag_;  // of (2), divided by M
  double gain_rad_s_, half_decay_;                // km, and e^{-step/(2 Tm)}
  double rate_rad_s_ = 0, velocity_m_s_ = 0, position_m_ = 0;
};

class Plant {
 public:
  Plant(const PlantParameters& parameters, double dt_s);

  void step(double duty);

  double position_m() const { return position_m_; }
  double velocity_m_s() const { return velocity_m_s_; }
  double acceleration_m_s2() const { return acceleration_m_s2_; }

  // See ModalPlant; the others have nothing of the kind.
  void prefetch() const {
    if (const auto* modal = std::get_if<control::ModalPlant>(&motion_)) modal->prefetch();
  }

 private:
  double delayed(double duty);

  std::variant<control::ModalPlant, NonlinearPlant, ShearThinningPlant> motion_;
  control::DelayLine delay_;  // of what is not linear
  double position_m_ = 0, velocity_m_s_ = 0, acceleration_m_s2_ = 0;
};

}  // namespace sim_robot
