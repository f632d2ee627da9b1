// Lagrange's cubic, and its derivative.
#include "control/sensor/position_times.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "control/sensor/position_weight.hpp"

namespace control {
namespace {

using Eigen::Index;

// x in ticks: the first of the four ticks, and where x lies among them, 0 to 3.
struct Place {
  Index first = 0;
  double share = 0;
};

Place place_of(double x, Index ticks) {
  const Index first = std::clamp<Index>(static_cast<Index>(std::floor(x)) - 1, 0, std::max<Index>(0, ticks - 4));
  return {first, x - static_cast<double>(first)};
}

double cubic(const double* y, double u) {
  const double a = u, b = u - 1, c = u - 2, d = u - 3;
  return -y[0] * b * c * d / 6 + y[1] * a * c * d / 2 - y[2] * a * b * d / 2 + y[3] * a * b * c / 6;
}

double cubic_slope(const double* y, double u) {
  const double a = u, b = u - 1, c = u - 2, d = u - 3;
  return -y[0] * (b * c + b * d + c * d) / 6 + y[1] * (a * c + a * d + c * d) / 2 - y[2] * (a * b + a * d + b * d) / 2 +
         y[3] * (a * b + a * c + b * c) / 6;
}

}  // namespace

PositionTimes::PositionTimes(std::vector<double> time_s, double dt_s, const std::vector<double>& sd_m)
    : time_s_(std::move(time_s)), dt_s_(dt_s), weight_(Eigen::VectorXd::Ones(size())) {
  if (sd_m.empty()) return;
  weight_ = sd_of_mean_weight(sd_m) * Eigen::Map<const Eigen::VectorXd>(sd_m.data(), size()).cwiseInverse();
}

Eigen::VectorXd PositionTimes::weighed(const Eigen::VectorXd& values) const { return values.cwiseProduct(weight_); }

Eigen::VectorXd PositionTimes::read(const Eigen::VectorXd& at_ticks, double shift_s) const {
  const Index last = at_ticks.size() - 1;
  Eigen::VectorXd result(size());
  for (Index i = 0; i < size(); ++i) {
    const double x = (time_s_[static_cast<std::size_t>(i)] + shift_s) / dt_s_;
    if (!(x > 0)) {
      result[i] = at_ticks[0];
    } else if (x >= static_cast<double>(last)) {
      result[i] = at_ticks[last] + (x - static_cast<double>(last)) * (at_ticks[last] - at_ticks[last - 1]);
    } else {
      const Place place = place_of(x, at_ticks.size());
      result[i] = cubic(at_ticks.data() + place.first, place.share);
    }
  }
  return result;
}

Eigen::VectorXd PositionTimes::slope(const Eigen::VectorXd& at_ticks, double shift_s) const {
  const Index last = at_ticks.size() - 1;
  Eigen::VectorXd result(size());
  for (Index i = 0; i < size(); ++i) {
    const double x = (time_s_[static_cast<std::size_t>(i)] + shift_s) / dt_s_;
    if (!(x > 0)) {
      result[i] = 0;
    } else if (x >= static_cast<double>(last)) {
      result[i] = (at_ticks[last] - at_ticks[last - 1]) / dt_s_;
    } else {
      const Place place = place_of(x, at_ticks.size());
      result[i] = cubic_slope(at_ticks.data() + place.first, place.share) / dt_s_;
    }
  }
  return result;
}

}  // namespace control
