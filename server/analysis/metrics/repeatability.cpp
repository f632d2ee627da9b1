// The quantile of Student's t is Boost's.
#include "server/analysis/metrics/repeatability.hpp"

#include <boost/math/distributions/students_t.hpp>
#include <cmath>

namespace server::analysis {
namespace {

constexpr double kRepeatabilityFactor = 2.8;
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
  const boost::math::students_t distribution{n - 1};
  result.confidence_half_width = boost::math::quantile(distribution, kTwoSided95) * *result.sd / std::sqrt(n);
  result.repeatability_limit = kRepeatabilityFactor * *result.sd;
  return result;
}

}  // namespace server::analysis
