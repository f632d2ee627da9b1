// Two parameters by Levenberg-Marquardt, from the best of a grid of time constants.
#include "control/search/motor_fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unsupported/Eigen/NonLinearOptimization>

#include "base/invalid_argument.hpp"
#include "control/search/fit_statistics.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr std::size_t kFewestSamples = 10;

template <typename... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  base::throw_invalid("motor fit: ", parts...);
}

void check(double dt_s, std::span<const double> duty, std::span<const double> rate_rad_s) {
  if (!(dt_s > 0 && std::isfinite(dt_s))) refuse("dt_s must be positive, is ", dt_s);
  if (duty.size() < kFewestSamples) refuse("duty has ", duty.size(), " samples: record at least ", kFewestSamples);
  if (rate_rad_s.size() != duty.size()) {
    refuse("rate_rad_s has ", rate_rad_s.size(), " values, duty has ", duty.size(), ": give one per sample");
  }
  for (std::size_t k = 0; k < duty.size(); ++k) {
    if (!std::isfinite(duty[k])) refuse("duty[", k, "] is ", duty[k], ": remove or repair it");
    if (!std::isfinite(rate_rad_s[k])) refuse("rate_rad_s[", k, "] is ", rate_rad_s[k], ": remove or repair it");
  }
  if (std::all_of(duty.begin(), duty.end() - 1, [](double value) { return value == 0; })) {
    refuse("duty is 0 throughout, which excites nothing: record a run with a step");
  }
  if (std::ranges::all_of(rate_rad_s, [&](double rate) { return rate == rate_rad_s.front(); })) {
    refuse("rate_rad_s is ", rate_rad_s.front(), " throughout: record a run in which the rate changes");
  }
}

// (1) for gain 1 and for the first rate, and the derivatives of both with respect to ln Tm.
struct Response {
  Eigen::VectorXd forced, forced_slope, free, free_slope;
};

Response response(double dt_s, std::span<const double> duty, double time_constant_s) {
  const Index samples = static_cast<Index>(duty.size());
  const double decay = std::exp(-dt_s / time_constant_s), gain = -std::expm1(-dt_s / time_constant_s);
  const double decay_slope = decay * dt_s / time_constant_s;
  Response r{Eigen::VectorXd::Zero(samples), Eigen::VectorXd::Zero(samples), Eigen::VectorXd::Ones(samples),
             Eigen::VectorXd::Zero(samples)};
  for (Index k = 0; k + 1 < samples; ++k) {
    const double u = duty[static_cast<std::size_t>(k)];
    r.forced[k + 1] = decay * r.forced[k] + gain * u;
    r.forced_slope[k + 1] = decay * r.forced_slope[k] + decay_slope * (r.forced[k] - u);
    r.free[k + 1] = decay * r.free[k];
    r.free_slope[k + 1] = decay * r.free_slope[k] + decay_slope * r.free[k];
  }
  return r;
}

struct Descent {  // x: km as a share of its start, ln Tm
  using Scalar = double;
  double dt_s;
  std::span<const double> duty;
  Eigen::VectorXd rate_rad_s;
  double gain_scale;

  int operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual) const {
    const Response r = response(dt_s, duty, std::exp(x[1]));
    residual = (rate_rad_s - x[0] * gain_scale * r.forced - rate_rad_s[0] * r.free) / gain_scale;
    if (!residual.allFinite()) residual.setConstant(1e100);
    return 0;
  }

  int df(const Eigen::VectorXd& x, Eigen::MatrixXd& slopes) const {
    const Response r = response(dt_s, duty, std::exp(x[1]));
    slopes.col(0) = -r.forced;
    slopes.col(1) = -x[0] * r.forced_slope - rate_rad_s[0] / gain_scale * r.free_slope;
    return 0;
  }

  Index values() const { return rate_rad_s.size(); }
};

MotorModel best_on_grid(double dt_s, std::span<const double> duty, const Eigen::VectorXd& rate_rad_s) {
  MotorModel best;
  double lowest = -1;
  const double longest_s = dt_s * static_cast<double>(duty.size());
  for (double time_constant_s = dt_s / 5; time_constant_s < 5 * longest_s; time_constant_s *= 1.6) {
    const Response r = response(dt_s, duty, time_constant_s);
    const Eigen::VectorXd rest = rate_rad_s - rate_rad_s[0] * r.free;
    const double gain = r.forced.dot(rest) / r.forced.squaredNorm();
    const double sse = (rest - gain * r.forced).squaredNorm();
    if (lowest < 0 || sse < lowest) best = {gain, time_constant_s}, lowest = sse;
  }
  return best;
}

}  // namespace

MotorFit fit_motor(double dt_s, std::span<const double> duty, std::span<const double> rate_rad_s) {
  check(dt_s, duty, rate_rad_s);
  const Eigen::VectorXd rate = Eigen::Map<const Eigen::VectorXd>(rate_rad_s.data(), static_cast<Index>(duty.size()));
  const MotorModel start = best_on_grid(dt_s, duty, rate);
  if (!(start.gain_rad_s > 0)) {
    refuse("the gain comes out as ", start.gain_rad_s, " rad/s: the rate must rise with the duty; turn one sign round");
  }
  Descent descent{dt_s, duty, rate, start.gain_rad_s};
  Eigen::LevenbergMarquardt<Descent> solver(descent);
  solver.parameters.ftol = solver.parameters.xtol = 1e-14;
  Eigen::VectorXd x{{1, std::log(start.time_constant_s)}};
  solver.minimize(x);

  MotorFit fit;
  fit.motor = {x[0] * start.gain_rad_s, std::exp(x[1])};
  Eigen::VectorXd residual(rate.size());
  descent(x, residual);
  residual *= start.gain_rad_s;
  fit.sse = residual.squaredNorm();
  fit.residual_sd_rad_s = std::sqrt(fit.sse / static_cast<double>(rate.size()));
  fit.fit_percent = 100 * (1 - residual.norm() / (rate.array() - rate.mean()).matrix().norm());
  Eigen::MatrixXd slopes(rate.size(), 2);
  descent.df(x, slopes);
  const double sd = std::max(1e-200, std::sqrt(fit.sse / static_cast<double>(rate.size() - 2)));
  const Uncertainty found = uncertainty(slopes * start.gain_rad_s / sd);
  const double unknown = std::numeric_limits<double>::infinity();
  fit.gain_sigma_rad_s = found.one_sigma[0] ? *found.one_sigma[0] * start.gain_rad_s : unknown;
  fit.time_constant_sigma_s = found.one_sigma[1] ? *found.one_sigma[1] * fit.motor.time_constant_s : unknown;
  return fit;
}

}  // namespace control
