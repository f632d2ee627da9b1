// Compares the ranges of both motions, without what a steady flow adds.
#include "server/analysis/reference_unit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace server::analysis {
namespace {

constexpr double kMostSpanRatio = 30, kSuspiciousSpanM = 2, kLeastOwnSpanM = 0.001;
constexpr double kOutlierShare = 0.01;  // of the positions, at each end, that a span leaves out
constexpr double kMillimetreRatio = 300;

// By least squares.
std::vector<double> without_line(const std::vector<double>& time_s, std::vector<double> position_m) {
  const auto count = static_cast<double>(time_s.size());
  const double mean_s = std::reduce(time_s.begin(), time_s.end()) / count;
  const double mean_m = std::reduce(position_m.begin(), position_m.end()) / count;
  double spread_s2 = 0, product_m_s = 0;
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    spread_s2 += (time_s[i] - mean_s) * (time_s[i] - mean_s);
    product_m_s += (time_s[i] - mean_s) * (position_m[i] - mean_m);
  }
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    position_m[i] -= mean_m + product_m_s / spread_s2 * (time_s[i] - mean_s);
  }
  return position_m;
}

double span_of(std::vector<double> positions_m) {
  std::ranges::sort(positions_m);
  const auto left_out = static_cast<std::size_t>(kOutlierShare * static_cast<double>(positions_m.size()));
  return positions_m[positions_m.size() - 1 - left_out] - positions_m[left_out];
}

}  // namespace

std::string unit_advice(double ratio) {
  if (ratio < kMostSpanRatio) return "are its positions in metres? If they are, say so (metres, --metres)";
  const bool is_mm = ratio >= kMillimetreRatio;
  return fmt::format(
      "they look like {}; if they are, divide position_m (and position_sd_m, if it has one) by {}; if they are metres, "
      "say so (metres, --metres)",
      is_mm ? "millimetres" : "centimetres", is_mm ? 1000 : 100);
}

Result<void> check_metres(const std::vector<double>& time_s, std::vector<double> outside_m, std::vector<double> own_m) {
  const double outside_span_m = span_of(without_line(time_s, std::move(outside_m)));
  const double own_span_m = span_of(without_line(time_s, std::move(own_m)));
  const double ratio = outside_span_m / own_span_m;
  if (outside_span_m < kSuspiciousSpanM || own_span_m < kLeastOwnSpanM || ratio < kMostSpanRatio) return {};
  return fail(ErrorCode::invalid,
              fmt::format("its positions range over {:.4g} m, those of the robot's own record over {:.4g} m, each "
                          "without a straight line in time: {}",
                          outside_span_m, own_span_m, unit_advice(ratio)),
              "out_of_range");
}

}  // namespace server::analysis
