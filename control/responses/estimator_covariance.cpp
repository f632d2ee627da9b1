#include "control/responses/estimator_covariance.hpp"

#include <algorithm>
#include <cmath>

namespace control {
namespace {

// The constants of robot_fw/core/estimator.cpp, by their names there.
constexpr int kTicksPerMeasurement = 5;
constexpr double kStartVelocityM_S = 0.0005, kGainWalk = 0.003, kSlip = 0.15, kRestingModelM_S = 0.0003;

struct ModelDoubt {
  double lag_s, correlation_s;
};
constexpr ModelDoubt kOfTheFluid{0.004, 0.1}, kAssumed{0.025, 0.5};

constexpr double kFastestNoise = 1.6;  // mean of the largest of five readings' noise, in its sds

constexpr double kInterval_s = kTicksPerMeasurement * kEstimateTick_s;

double square(double x) { return x * x; }

}  // namespace

double section_share(double time_constant_s) {
  const double x = kEstimateTick_s / time_constant_s;
  return 12 * x / (12 + 6 * x + x * x);
}

EstimatorCovariance::EstimatorCovariance(const EstimateParameters& parameters)
    : parameters_{parameters},
      gain_m_s_{parameters.gain_m_s.data()},
      fastest_change_m_s2_{kFastestNoise * parameters.noise_m_s2} {
  covariance_(1, 1) = square(kStartVelocityM_S);
  covariance_(2, 2) = square(parameters.bias_m_s2);
  auto of_gains = covariance_.bottomRightCorner<kEstimateSections, kEstimateSections>();
  of_gains = square(parameters.gain_error) * gain_m_s_ * gain_m_s_.transpose();
  if (!parameters.is_confirmed) of_gains.diagonal().array() += square(parameters.section_error * gain_m_s_.sum());
}

bool EstimatorCovariance::step(double duty, double change_m_s) {
  duty_ = duty;
  model_m_s_ = 0;
  for (std::size_t i = 0; i < kEstimateSections; ++i) {
    section_[i] += section_share(parameters_.time_constant_s[i]) * (duty - section_[i]);
    model_m_s_ += parameters_.gain_m_s[i] * section_[i];
  }
  velocity_variance_ += square(parameters_.noise_m_s2 * kEstimateTick_s) + square(kSlip * change_m_s);
  fastest_change_m_s2_ = std::max(fastest_change_m_s2_, std::abs(change_m_s) / kEstimateTick_s);
  if (++ticks_ < kTicksPerMeasurement) return false;
  propagate();
  compare();
  ticks_ = 0;
  velocity_variance_ = 0;
  fastest_change_m_s2_ = kFastestNoise * parameters_.noise_m_s2;
  return true;
}

// (2)
void EstimatorCovariance::propagate() {
  auto& p = covariance_;
  p.row(0) += kInterval_s * (p.row(1) - 0.5 * kInterval_s * p.row(2));
  p.row(1) -= kInterval_s * p.row(2);
  p.col(0) += kInterval_s * (p.col(1) - 0.5 * kInterval_s * p.col(2));
  p.col(1) -= kInterval_s * p.col(2);
  p(0, 0) += velocity_variance_ * square(kInterval_s) / 3;
  p(0, 1) += velocity_variance_ * kInterval_s / 2;
  p(1, 0) = p(0, 1);
  p(1, 1) += velocity_variance_;
  p(2, 2) += square(parameters_.bias_walk_m_s2) * kInterval_s;
  p.bottomRightCorner<kEstimateSections, kEstimateSections>() +=
      square(kGainWalk) * kInterval_s * gain_m_s_ * gain_m_s_.transpose();
}

bool EstimatorCovariance::is_at_rest() const { return duty_ == 0 && std::abs(model_m_s_) < kRestingModelM_S; }

double EstimatorCovariance::velocity_floor_m_s() const {
  return is_at_rest() ? parameters_.resting_velocity_m_s : parameters_.driven_velocity_m_s;
}

// (3)
void EstimatorCovariance::compare() {
  const ModelDoubt& doubt = parameters_.is_confirmed || is_at_rest() ? kOfTheFluid : kAssumed;
  const double shape = square(parameters_.shape_error * model_m_s_) + square(doubt.lag_s * fastest_change_m_s2_);
  const double area = parameters_.correlation_s * square(velocity_floor_m_s()) + doubt.correlation_s * shape;
  Errors h = Errors::Zero();
  h(1) = 1;
  for (std::size_t i = 0; i < kEstimateSections; ++i) h(3 + static_cast<Eigen::Index>(i)) = -section_[i];
  const Errors ph = covariance_ * h;
  gains_ = ph / (h.dot(ph) + 2 * area / kInterval_s);
  covariance_ -= gains_ * ph.transpose();
}

void EstimatorCovariance::zero_position() {
  covariance_.row(0).setZero();
  covariance_.col(0).setZero();
}

double EstimatorCovariance::position_sd_m() const { return std::sqrt(std::max(covariance_(0, 0), 0.0)); }

}  // namespace control
