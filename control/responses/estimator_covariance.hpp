// The covariance that the robot's estimator has of its own errors along a known motion, and its gains.
//
//   e = (e_x, e_v, e_b, d_1 … d_4): estimate less truth of position, velocity, bias; of each gain of the model    (1)
//   e_x' = e_v,  e_v' = n - e_b,  e_b' = white noise                                     P → F P Fᵀ + Q           (2)
//   e → e + K (Σ d_i y_i - e_v + ε) in every fifth tick,  K = P Hᵀ/(H P Hᵀ + R)                                   (3)
//   y_i → outputs of the sections, driven by the duty;  n → noise of a reading;  ε → error of the model, variance R
//
// It is robot_fw/core/estimator without its readings, since P and K follow from the duty and the motion. Not in it:
// flow, doubtful duties, surprises, readings that are missing.
// Accuracy: position_sd_m() within 3 % of the robot's along Figure 7's loop, held by
// tests/robot_fw/estimator_covariance_test. Errors: none thrown.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

namespace control {

inline constexpr std::size_t kEstimateSections = 4;
inline constexpr Eigen::Index kEstimateErrors = 3 + static_cast<Eigen::Index>(kEstimateSections);
inline constexpr double kEstimateTick_s = 0.01;

// The robot's parameters of these names (docs/robot.md) and their defaults: standard deviations, unless noted.
struct EstimateParameters {
  std::array<double, kEstimateSections> gain_m_s{};                       // per duty; no sd
  std::array<double, kEstimateSections> time_constant_s{1, 1, 1, 1};      // no sd
  bool is_confirmed = false;                                              // the model is that of the fluid
  double gain_error = 0.2, section_error = 0.1, shape_error = 0.05;       // relative
  double driven_velocity_m_s = 0.0004, resting_velocity_m_s = 0.0001;     // of the model's velocity
  double correlation_s = 0.5;                                             // of these two; no sd
  double noise_m_s2 = 0.013, bias_m_s2 = 0.003, bias_walk_m_s2 = 0.0003;  // of a reading; the last in 1 s
};

// 1 - e^-(tick/τ), as the robot computes it.
double section_share(double time_constant_s);

class EstimatorCovariance {
 public:
  using Errors = Eigen::Matrix<double, kEstimateErrors, 1>;
  using Covariance = Eigen::Matrix<double, kEstimateErrors, kEstimateErrors>;

  // At the start of the estimator, at rest.
  explicit EstimatorCovariance(const EstimateParameters& parameters);

  // A tick that ends now: the duty in it, and the change of the velocity. True: it ends with (3), by gains() and
  // section_outputs().
  bool step(double duty, double change_m_s);
  void zero_position();

  const Errors& gains() const { return gains_; }                                             // K
  const std::array<double, kEstimateSections>& section_outputs() const { return section_; }  // y
  const Covariance& covariance() const { return covariance_; }                               // P
  double model_velocity_m_s() const { return model_m_s_; }
  double velocity_floor_m_s() const;  // sd of the model's velocity, whatever it is
  double position_sd_m() const;

 private:
  bool is_at_rest() const;
  void propagate();
  void compare();

  EstimateParameters parameters_;
  Eigen::Matrix<double, kEstimateSections, 1> gain_m_s_;
  Covariance covariance_ = Covariance::Zero();
  Errors gains_ = Errors::Zero();
  std::array<double, kEstimateSections> section_{};
  double duty_ = 0, model_m_s_ = 0;
  int ticks_ = 0;                 // since the last (3), and what came in since then:
  double velocity_variance_ = 0;  // (m/s)²
  double fastest_change_m_s2_;    // of the velocity, noise included
};

}  // namespace control
