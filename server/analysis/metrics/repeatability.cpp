// The quantile of Student's t is Boost's.
#include "server/analysis/metrics/repeatability.hpp"

#include <boost/math/distributions/students_t.hpp>
#include <cmath>

namespace server::analysis {
namespace {

constexpr double kTwoSided95 = 0.975;

}  // namespace

Repeatability repeatability_of(std::span<const std::optional<double>> values) {
  Repeatability result;
  double sum = 0;
  for (const auto& value : values) {
    if (!value) continue;
    sum += *value;
    ++result.runs;
  }
  if (result.runs == 0) return result;
  const auto n = static_cast<double>(result.runs);
  result.mean = sum / n;
  if (result.runs < 2) return result;
  double squares = 0;
  for (const auto& value : values) {
    if (value) squares += (*value - *result.mean) * (*value - *result.mean);
  }
  result.sd = std::sqrt(squares / (n - 1));
  const double t = boost::math::quantile(boost::math::students_t{n - 1}, kTwoSided95);
  result.confidence_half_width = t * *result.sd / std::sqrt(n);
  result.repeatability_limit = t * std::sqrt(2.0) * *result.sd;
  return result;
}

}  // namespace server::analysis
