// Responses of fixed rates to a recorded duty: the output of every model is a linear combination of them.
//
//   H(s) = H₁(s) + r/(s - p) + r̄/(s - p̄)                           (1)   the pole pair, if arg p < 0.942 π
//   v(t) = Σ_i 2 Re[c_i (e^{s_i t} - κ_i)]                         (2)   step response of H₁: velocity
//   x(t) = Σ_i 2 Re[c_i (e^{s_i t} - κ_i (1 + 3 s_i/a + s_i t))/s_i]    (3)   and its integral: position
//   a(t) = Σ_i 2 Re[c_i s_i e^{s_i t}]                            (5)   and its slope: acceleration
//   s_i = e^{y_i + iθ},  c_i = (δ/2πi) H₁(s_i),  κ_i = (1 + s_i/a)^-3   (4)
//
// (2) is the inverse Laplace integral of H₁/s on a ray of angle θ, by the trapezoid in y with step δ. What is taken
// from e^{st} integrates to nothing (it is analytic right of the ray and decays) and makes the integrand vanish at s =
// 0, so that the rates need to span only what the record can see, whatever the model: without the pole pair, H₁ is
// smooth between the imaginary axis and the cut. So the rates are fixed, and the parameters are in the c_i alone. The
// responses are nearly dependent. Those of the slow rates are polynomials in t, so integrals of the duty; among the
// others a pivoted QR picks the columns that span them all.
// Shapes:   log_rate has length K; expansion is rank × 2K and acts on (2 Re c, -2 Im c); responses are samples × rank.
// Accuracy: 1e-11 of the largest output at tolerance 1e-13 (4e-12 seen), held by output_model_test.cpp.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <span>
#include <vector>

#include "control/models/transfer_function.hpp"

namespace control {

// Asked between the columns of long records; what is computed after it said true is of no use.
using Stop = std::function<bool()>;

enum class Channel { position, velocity, acceleration };

inline constexpr Eigen::Index kIntegrals = 9;  // of the duty, from none on

// A duty that changes at the samples, delayed; the robot is at rest before the first sample. A change between two
// samples is exact too.
struct DelayedDuty {
  double dt_s;
  double lead_s;             // from a change to the next sample
  Eigen::VectorXd change;    // seen first at sample k + 1
  Eigen::MatrixXd integral;  // column l: the duty integrated l times, at each sample; column 0 is just before it
};

DelayedDuty delayed(std::span<const double> duty, double dt_s, double delay_s);

// Σ_j change_j e^{s (t - t_j)} at each sample, and its derivative with respect to s.
Eigen::VectorXcd exponential_response(const DelayedDuty& duty, Complex rate);
Eigen::VectorXcd exponential_response_slope(const DelayedDuty& duty, Complex rate, const Eigen::VectorXcd& response);

class ModalRegressors {
 public:
  // shortest_s: the shortest time between a change of the duty and a sample that must be exact.
  ModalRegressors(Channel channel, double dt_s, Eigen::Index samples, double shortest_s, double tolerance);

  const std::vector<Complex>& log_rate() const { return log_rate_; }
  double log_step() const { return log_step_; }  // δ
  const Eigen::MatrixXd& expansion() const { return expansion_; }

  Eigen::MatrixXd responses(const DelayedDuty& duty, const Stop& stop = {}) const;
  Eigen::MatrixXd response_slopes(const DelayedDuty& duty,
                                  const Stop& stop = {}) const;  // their derivatives with respect to time

 private:
  struct Column {
    Complex rate;
    bool is_imaginary;
  };

  Eigen::MatrixXd stepped(const DelayedDuty& duty, int derivative, const Stop& stop) const;
  Complex rate(Eigen::Index i) const { return std::exp(log_rate_[static_cast<std::size_t>(i)]); }
  void lay_rates(double longest_s, double shortest_s, double tolerance);
  void choose_columns(double longest_s, double shortest_s);
  void expand_slow_rates();
  Eigen::MatrixXd sampled_step_responses(const Eigen::VectorXd& time_s) const;
  Complex scale(Complex rate) const;                     // of e^{st}: 1/s, 1 or s
  std::array<Complex, 2> taken_off(Complex rate) const;  // from e^{st} in (2), (3), (5): coefficients of 1 and t

  Channel channel_;
  double log_step_ = 0;
  double turn_rate_ = 0;  // a
  std::vector<Complex> log_rate_;
  Eigen::Index slow_ = 0;  // how many of the rates are slow
  std::vector<Column> columns_;
  Eigen::MatrixXd expansion_;
};

inline constexpr double kLargestPoleAngle = 0.942;  // of (1), in units of π

}  // namespace control
