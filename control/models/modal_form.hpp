// Writes a model as a sum of decaying exponentials, which can be stepped exactly.
//
//   h(t) = (1/π) Im ∫_0^∞ H(s) e^{st} ds  along s = x e^{iθ},  + 2 Re[r e^{pt}]  if the pole p has arg p < θ   (1)
//        ≈ Σ_i 2 Re[w_i e^{s_i t}],   s_i = e^{y_i + iθ},  w_i = (δ/2πi) H(s_i) s_i                            (2)
//   r = kp/D'(p)                                                                                                 (3)
//   H(s) = H(0) a/(s + a) + rest: the first term is one slow real mode, (2) is applied to the rest              (4)
//
// (1) is the inverse Laplace integral bent onto two rays, which is allowed because H is analytic in the plane cut along
// the negative real axis but for at most one pole pair, and because no ray crosses it. (2) is the trapezoid in y = ln x
// with step δ. Its error is about exp(-2πd/δ), d being the angle between the ray and the nearest of: the imaginary axis
// (where e^{st} stops decaying), the pole, the cut. The ray takes the middle of the wider gap, so d ≥ π/8 for every
// model and no parameters need thousands of modes. (4) makes the rest vanish at s = 0, so that the sum may begin at
// much faster rates. What the sum leaves out beyond its fastest rate is one more real mode of that rate: such modes
// have settled by shortest_s, so only their sum matters.
//
// The form excludes the model's dead time: h is the response after it. Code that steps the form delays the duty.
// Shapes:   rate and weight have the same length; every rate lies left of the imaginary axis, in the upper half plane
//           or on the real axis, and its mode counts twice the real part.
// Accuracy: velocity and position step responses for shortest_s ≤ t ≤ longest_s within `tolerance` relative, or within
//           1e-15 of kp/b3 and of kp/b3·t where that is more (rounding: a model of hours has hardly begun after
//           milliseconds). Where a lightly damped velocity swings through zero it is relative to the mean so far. For
//           all models of time scales from 1 ms to hours, held by modal_form_test.cpp; 178 modes for (29) at 1e-7, 454
//           at 1e-13.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <optional>
#include <vector>

#include "control/models/transfer_function.hpp"

namespace control {

struct ModalRange {
  double shortest_s = 0.01;
  double longest_s = 1e5;
  double tolerance = 1e-7;
};

struct ModalForm {
  std::vector<Complex> rate;    // s_i, 1/s
  std::vector<Complex> weight;  // w_i, m/s² per duty
};

// The rates of (2), which are the same for all models that share a ray: count values of y from first_log_rate on.
struct Ray {
  double angle_rad = 0;  // θ
  double log_step = 0;   // δ
  double first_log_rate = 0;
  int count = 0;
  double slow_rate = 0;  // a of (4), 1/s
  double growth = 1;     // |D(i/shortest_s)|/b3: of the response after shortest_s

  Complex rate(int i) const { return std::polar(std::exp(first_log_rate + i * log_step), angle_rad); }
};

// ln p of the pole with 0 < arg p < π, if there is one nearer than π - 1e-7; there is never a second.
std::optional<Complex> log_pole(const FractionalModel& model);

struct PolePair {
  Complex pole;     // p, 1/s; the other is its conjugate
  Complex residue;  // r of (3)
};

// The pole pair if 0 < arg p < largest_angle_rad and p is between e^-200 and e^200 1/s.
std::optional<PolePair> pole_pair(const FractionalModel& model, double largest_angle_rad);

Ray choose_ray(const FractionalModel& model, const ModalRange& range);

ModalForm modal_form(const FractionalModel& model, const ModalRange& range);

// Over dt_s under a constant duty u a mode y' = s y + w u changes exactly:
//   y → decay·y + integral·w u,   ∫y dt = integral·y + double_integral·w u                                        (5)
struct StepFactors {
  Complex decay;            // e^{s dt}
  Complex integral;         // (e^{s dt} - 1)/s, s
  Complex double_integral;  // (e^{s dt} - 1 - s dt)/s², s²
};

StepFactors step_factors(Complex rate, double dt_s);

}  // namespace control
