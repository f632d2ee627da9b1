// Lays the rates, finds which of their responses span the others, and steps those through the duty.
#include "control/models/modal_regressors.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace control {
namespace {

using Eigen::Index;
using std::numbers::pi;

constexpr double kRankTolerance = 1e-15;  // of the largest response
constexpr double kSlowest = 0.05;         // of the rates that are not slow, times the longest time

// Calls visit(k, response) for samples 1, 2, ...; written out in real numbers, which is several times faster.
template <typename Visit>
void step_through(const DelayedDuty& duty, Complex rate, Visit visit) {
  const Complex decay = std::exp(rate * duty.dt_s), lead = std::exp(rate * duty.lead_s);
  double real = 0, imaginary = 0;
  for (Index k = 0; k < duty.change.size(); ++k) {
    const double next = decay.real() * real - decay.imag() * imaginary + lead.real() * duty.change[k];
    imaginary = decay.real() * imaginary + decay.imag() * real + lead.imag() * duty.change[k];
    real = next;
    visit(k + 1, real, imaginary);
  }
}

// t^l/l!
Eigen::Vector<double, kIntegrals> taylor_powers(double t) {
  Eigen::Vector<double, kIntegrals> power;
  power[0] = 1;
  for (Index l = 1; l < kIntegrals; ++l) power[l] = power[l - 1] * t / static_cast<double>(l);
  return power;
}

}  // namespace

DelayedDuty delayed(std::span<const double> duty, double dt_s, double delay_s) {
  const Index samples = static_cast<Index>(duty.size());
  const double whole = std::floor(delay_s / dt_s);
  const Index skipped = static_cast<Index>(std::min(whole, static_cast<double>(samples)));
  DelayedDuty result{dt_s, dt_s - (delay_s - whole * dt_s), Eigen::VectorXd::Zero(samples - 1),
                     Eigen::MatrixXd::Zero(samples, kIntegrals)};
  const auto step = taylor_powers(dt_s), lead = taylor_powers(result.lead_s);
  for (Index k = 0; k + 1 < samples; ++k) {
    const Index from = k - skipped;
    const auto at = static_cast<std::size_t>(from);
    if (from >= 0) result.change[k] = duty[at] - (from > 0 ? duty[at - 1] : 0);
    for (Index l = 0; l < kIntegrals; ++l) {
      double sum = lead[l] * result.change[k];
      for (Index i = 0; i <= l; ++i) sum += step[i] * result.integral(k, l - i);
      result.integral(k + 1, l) = sum;
    }
  }
  return result;
}

Eigen::VectorXcd exponential_response(const DelayedDuty& duty, Complex rate) {
  Eigen::VectorXcd response = Eigen::VectorXcd::Zero(duty.integral.rows());
  step_through(duty, rate, [&](Index k, double real, double imaginary) { response[k] = {real, imaginary}; });
  return response;
}

Eigen::VectorXcd exponential_response_slope(const DelayedDuty& duty, Complex rate, const Eigen::VectorXcd& response) {
  const Complex decay = std::exp(rate * duty.dt_s), lead = duty.lead_s * std::exp(rate * duty.lead_s);
  Eigen::VectorXcd slope = Eigen::VectorXcd::Zero(duty.integral.rows());
  double real = 0, imaginary = 0;
  for (Index k = 0; k < duty.change.size(); ++k) {
    real += duty.dt_s * response[k].real();
    imaginary += duty.dt_s * response[k].imag();
    const double next = decay.real() * real - decay.imag() * imaginary + lead.real() * duty.change[k];
    imaginary = decay.real() * imaginary + decay.imag() * real + lead.imag() * duty.change[k];
    real = next;
    slope[k + 1] = {real, imaginary};
  }
  return slope;
}

ModalRegressors::ModalRegressors(Channel channel, double dt_s, Index samples, double shortest_s, double tolerance)
    : channel_(channel) {
  const double longest_s = dt_s * static_cast<double>(samples - 1);
  lay_rates(longest_s, shortest_s, tolerance);
  choose_columns(longest_s, shortest_s);
  expand_slow_rates();
}

void ModalRegressors::lay_rates(double longest_s, double shortest_s, double tolerance) {
  const double digits = -std::log(tolerance);
  const double for_turn = 8;  // the pole of κ on the cut, of order 3, needs a wider berth
  const double angle_rad = pi / 2 + pi / 2 * digits / (2 * digits + for_turn);
  log_step_ = 2 * pi * (angle_rad - pi / 2) / digits;
  turn_rate_ = 3 / longest_s;
  const double decayed = std::log(digits / (-std::cos(angle_rad) * shortest_s));      // e^{st} at shortest_s
  const double highest = std::max(decayed, std::log(turn_rate_) + (digits + 2) / 3);  // and κ
  const double lowest = -digits - std::log(longest_s);  // (2) and (3) are of the size of s t
  for (double y = lowest; y < highest + log_step_; y += log_step_) {
    log_rate_.emplace_back(y, angle_rad);
    if (y < std::log(kSlowest / longest_s)) ++slow_;
  }
}

Complex ModalRegressors::scale(Complex rate) const {
  switch (channel_) {
    case Channel::position: return 1.0 / rate;
    case Channel::velocity: return 1.0;
    case Channel::acceleration: return rate;
  }
  return 0.0;
}

std::array<Complex, 2> ModalRegressors::taken_off(Complex rate) const {
  if (channel_ == Channel::acceleration) return {0.0, 0.0};
  const Complex w = rate / turn_rate_, kappa = 1.0 / ((1.0 + w) * (1.0 + w) * (1.0 + w));
  if (channel_ == Channel::velocity) return {kappa, 0.0};
  return {kappa * (1.0 + 3.0 * w), kappa * rate};
}

// One column for the real part of each rate that is not slow, then one for its imaginary part.
Eigen::MatrixXd ModalRegressors::sampled_step_responses(const Eigen::VectorXd& time_s) const {
  const Index fast = static_cast<Index>(log_rate_.size()) - slow_;
  Eigen::MatrixXd result(time_s.size(), 2 * fast);
  for (Index i = 0; i < fast; ++i) {
    const Complex s = rate(slow_ + i), gain = scale(s);
    const auto [constant, linear] = taken_off(s);
    for (Index k = 0; k < time_s.size(); ++k) {
      const Complex value = (std::exp(s * time_s[k]) - constant - linear * time_s[k]) * gain;
      result(k, i) = value.real();
      result(k, i + fast) = value.imag();
    }
  }
  return result;
}

void ModalRegressors::choose_columns(double longest_s, double shortest_s) {
  const Index times = 60 + static_cast<Index>(32 * std::log10(longest_s / shortest_s));
  const Eigen::VectorXd log_time = Eigen::VectorXd::LinSpaced(times, std::log(shortest_s), std::log(longest_s));
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(sampled_step_responses(log_time.array().exp().matrix()));
  const auto& r = qr.matrixQR();
  const auto& order = qr.colsPermutation().indices();
  const Index rates = static_cast<Index>(log_rate_.size()), fast = rates - slow_, most = std::min(times, 2 * fast);
  Index rank = 1;
  while (rank < most && std::abs(r(rank, rank)) > kRankTolerance * std::abs(r(0, 0))) ++rank;

  const Eigen::MatrixXd others =
      r.topLeftCorner(rank, rank).triangularView<Eigen::Upper>().solve(r.topRightCorner(rank, 2 * fast - rank));
  expansion_ = Eigen::MatrixXd::Zero(rank + kIntegrals, 2 * rates);
  for (Index j = 0; j < 2 * fast; ++j) {
    const bool is_imaginary = order[j] >= fast;
    const Index i = slow_ + order[j] % fast;
    auto column = expansion_.col(is_imaginary ? i + rates : i);
    if (j < rank) {
      column[j] = 1;
      columns_.push_back({rate(i), is_imaginary});
    } else {
      column.head(rank) = others.col(j - rank);
    }
  }
}

// (2), (3) and (5) in powers of t; the last rows of the expansion are for the integrals of the duty.
void ModalRegressors::expand_slow_rates() {
  const Index rates = static_cast<Index>(log_rate_.size());
  for (Index i = 0; i < slow_; ++i) {
    const Complex s = rate(i), w = s / turn_rate_, kappa = 1.0 / ((1.0 + w) * (1.0 + w) * (1.0 + w));
    const Complex less_kappa = kappa * w * (3.0 + w * (3.0 + w));  // 1 - κ
    Eigen::Vector<Complex, kIntegrals> coefficient;
    Complex power = 1;
    Index first = 0;
    if (channel_ == Channel::position) coefficient[first++] = kappa * w * w * (3.0 + w) / s;
    if (channel_ != Channel::acceleration) coefficient[first++] = less_kappa;
    for (Index l = first; l < kIntegrals; ++l) coefficient[l] = power *= s;
    expansion_.col(i).tail(kIntegrals) = coefficient.real();
    expansion_.col(i + rates).tail(kIntegrals) = coefficient.imag();
  }
}

Eigen::MatrixXd ModalRegressors::responses(const DelayedDuty& duty, const Stop& stop) const {
  Eigen::MatrixXd result = stepped(duty, 0, stop);
  result.rightCols(kIntegrals) = duty.integral;
  return result;
}

Eigen::MatrixXd ModalRegressors::response_slopes(const DelayedDuty& duty, const Stop& stop) const {
  Eigen::MatrixXd result = stepped(duty, 1, stop);
  result.col(result.cols() - kIntegrals).setZero();
  result.rightCols(kIntegrals - 1) = duty.integral.leftCols(kIntegrals - 1);
  return result;
}

// All columns but those of the integrals.
Eigen::MatrixXd ModalRegressors::stepped(const DelayedDuty& duty, int derivative, const Stop& stop) const {
  const Index count = static_cast<Index>(columns_.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(duty.integral.rows(), count + kIntegrals);
  for (Index j = 0; j < count && !(stop && stop()); ++j) {
    const auto [s, is_imaginary] = columns_[static_cast<std::size_t>(j)];
    const Complex turn = is_imaginary ? Complex{0, -1} : Complex{1, 0};  // so that the real part is what is wanted
    const Complex value = turn * scale(s);
    const auto [constant, linear] = taken_off(s);
    const double level_gain = ((derivative == 0 ? constant : linear) * value).real();
    const double area_gain = derivative == 0 ? (linear * value).real() : 0;
    const Complex gain = derivative == 0 ? value : value * s;
    auto column = result.col(j);
    column.noalias() = -level_gain * duty.integral.col(0) - area_gain * duty.integral.col(1);
    step_through(duty, s, [&](Index k, double real, double imaginary) {
      column[k] += gain.real() * real - gain.imag() * imaginary;
    });
  }
  return result;
}

}  // namespace control
