// The motion models of the paper, and the hydrodynamics that one of them comes from.
//
//   H(s) = kp / (b1 s^α + b2 s^β + b3)                     (1)   velocity, m/s per duty: [birs2021] (20), (28), (29);
//                                                                position, m per duty: H(s)/s, (22)
//   with a dead time T: H(s) e^{-sT}                              (1a)  the duty acts so much later; not in the paper
//   H_motor(s) = km / (Tm s + 1)                           (2)   propeller rate, rad/s per duty: (17), (27)
//   M = m + (4/3) β ρ π · π d²/4                           (3)   mass and added mass: (12), read so that it gives (28)
//   D = 2 u0 X|u|u + Xu,  X|u|u = ρ Cd Af/2,  Xu = ρ V Af Cd     (4)   (13), (14)
//   H(s) = k / (s² + (1/Tm + D/M) s + D/(Tm M))            (5)   (18), (19), normalised
//   k = km Ct ρ A r² / (Tm M)                              (6)   (18), read literally
//
// Differs from the paper: (3) has π (d/2)² where (12) prints (d/2)²; only so are 60.13 and 667.1 of (28) met, within
// 0.04 % and 0.15 %. No sound reading of (18) gives its 232; (6) gives 3.4 to 3.6. The model keeps 232 as an empirical
// gain and carries (6) beside it.
// Errors: the check functions throw std::invalid_argument quoting the bad value. They name what is allowed.
#pragma once

namespace control {

// (1). 0 < beta < alpha ≤ 2 and beta ≤ 1; b1 ≥ 0, b2, b3 > 0: all of these models are stable. With b1 = 0 the first
// term is absent, alpha has no effect, and beta = 1 makes a first-order lag. dead_time_s ≥ 0 is T of (1a): whatever
// takes a model takes it into account, or throws where it cannot.
struct FractionalModel {
  double kp = 0.1;
  double b1 = 0.005682;
  double b2 = 0.11031;
  double b3 = 1.0;
  double alpha = 1.7263;
  double beta = 0.8682;
  double dead_time_s = 0;

  bool operator==(const FractionalModel&) const = default;
};

constexpr FractionalModel kNonNewtonianModel{};                                 // (29) of the paper
constexpr FractionalModel kNewtonianModel{232.0, 1.0, 60.13, 667.1, 2.0, 1.0};  // (28) of the paper

void check(const FractionalModel& model);

// The same model with b3 = 1: one of kp, b1, b2, b3 is redundant.
FractionalModel normalised(const FractionalModel& model);

// (2)
struct MotorModel {
  double gain_rad_s = 700;  // km, per duty
  double time_constant_s = 0.022;
};

void check(const MotorModel& model);

// Table 1 of the paper.
struct HydrodynamicParameters {
  double thrust_coefficient = 0.3;         // Ct
  double drag_coefficient = 0.6;           // Cd
  double propeller_diameter_m = 0.04;      // d
  double propeller_radius_m = 0.02;        // r
  double blade_area_m2 = 0.0013;           // A
  double fluid_density_kg_m3 = 1060;       // ρ
  double frontal_area_m2 = 0.031;          // Af
  double added_mass_coefficient = 0.2473;  // β, dimensionless
  double flow_velocity_m_s = 0.1;          // V
  double mass_kg = 0.1;                    // m
  double operating_velocity_m_s = 1;       // u0
  MotorModel motor;
  double numerator = 232;  // k of (5), as printed in (28); empirical
};

struct HydrodynamicModel {
  FractionalModel model;           // (5) with the given numerator; b1 = 1, alpha = 2, beta = 1
  double derived_numerator = 0;    // (6), to be shown beside it
  double total_mass_kg = 0;        // M
  double damping_kg_s = 0;         // D
  double linear_drag_kg_s = 0;     // Xu
  double quadratic_drag_kg_m = 0;  // X|u|u
};

HydrodynamicModel hydrodynamic_model(const HydrodynamicParameters& parameters);

}  // namespace control
