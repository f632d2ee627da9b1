// Simulates the robot's motion as a sum of exponentials, exact for a duty that is constant between steps.
//
//   H(s) = k / (b1 s^α + b2 s^β + b3),  position = H(s)/s · duty        (1)   the paper's (20), (29); m/s per duty
//   H(s) = 2 Re[r/(s - p)] + ∫_0^∞ m(x)/(s + x) dx                      (2)   pole pair and branch cut
//   m(x) = -Im[H(x e^{iπ})]/π,  r = k/D'(p)                             (3)   D: the denominator of (1)
//   ∫ m(x)/(s + x) dx ≈ Σ_i h x_i m(x_i)/(s + x_i),  ln x_i = -10..12   (4)   trapezoid in ln x
//
// Each term of (2) and (4) is one first-order state y' = -x y + c u, advanced exactly; velocity is the sum of the
// states. Orders 2 and 1 have no cut: (1) is then two poles, real or complex. Accuracy: 2e-6 relative for (29) from 10
// ms to 60 s at any step size, held by modal_plant_test.cpp. Errors:   throws std::invalid_argument quoting the bad
// value.
#pragma once

#include <complex>
#include <vector>

#include "control/plant_models.hpp"

namespace control {

class ModalPlant {
 public:
  ModalPlant(const FractionalModel& model, double dt_s);

  // Advances by dt_s under a constant duty.
  void step(double duty);

  double position_m() const { return position_m_; }
  double velocity_m_s() const { return velocity_m_s_; }
  double acceleration_m_s2() const;  // at the end of the last step, under its duty

  void reset();

 private:
  struct RealMode {
    double rate;            // x: y' = -x y + c u
    double weight;          // c
    double decay;           // y after dt, per y
    double input;           // y after dt, per u
    double position;        // ∫y over dt, per y
    double position_input;  // ∫y over dt, per u
    double state;           // y
  };
  struct ComplexMode {  // stands for itself and its conjugate
    std::complex<double> pole, weight, decay, input, position, position_input, state;
  };

  void add_real_mode(double rate, double weight);
  void add_complex_mode(std::complex<double> pole, std::complex<double> residue);
  void add_integer_order_modes(const FractionalModel& model);
  void add_fractional_order_modes(const FractionalModel& model);

  double dt_s_;
  std::vector<RealMode> real_modes_;
  std::vector<ComplexMode> complex_modes_;
  double duty_ = 0;
  double position_m_ = 0;
  double velocity_m_s_ = 0;
};

}  // namespace control
