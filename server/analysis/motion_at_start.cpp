// The slope at the first sample, from a cubic through the first few: acceleration from rest has none.
#include "server/analysis/motion_at_start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

namespace server::analysis {
namespace {

constexpr std::size_t kSamples = 12;
constexpr double kSigmas = 5;
constexpr double kOfPeak = 0.3;          // below it, the bend of a start from rest may look like motion
constexpr double kOfPeakCoasting = 0.1;  // without duty, nothing bends

struct Estimate {
  double value = 0, sigma = 0;
};

// Polynomials over t = 0, 1, 2, … that are orthogonal to each other, of degree 0 to 3, and their slopes at t = 0.
struct Polynomial {
  std::array<double, kSamples> values{};
  double slope = 0;
};

std::array<Polynomial, 4> orthogonal_polynomials() {
  std::array<Polynomial, 4> made;
  for (std::size_t degree = 0; degree < made.size(); ++degree) {
    Polynomial& p = made[degree];
    for (std::size_t t = 0; t < kSamples; ++t) p.values[t] = std::pow(static_cast<double>(t), degree);
    p.slope = degree == 1 ? 1 : 0;
    for (std::size_t lower = 0; lower < degree; ++lower) {
      const auto& other = made[lower].values;
      const double share = std::inner_product(other.begin(), other.end(), p.values.begin(), 0.0);
      for (std::size_t t = 0; t < kSamples; ++t) p.values[t] -= share * other[t];
      p.slope -= share * made[lower].slope;
    }
    const double norm = std::sqrt(std::inner_product(p.values.begin(), p.values.end(), p.values.begin(), 0.0));
    for (double& value : p.values) value /= norm;
    p.slope /= norm;
  }
  return made;
}

// The slope at t = 0 of the polynomial of this degree that fits the values best, per sample; scatter about it.
struct Start {
  Estimate slope;
  double scatter = 0;
};

Start start_of(std::span<const double> values, std::size_t degree) {
  static const auto kPolynomials = orthogonal_polynomials();
  std::vector<double> rest;
  for (const double value : values) rest.push_back(value - values.front());
  Start start;
  double variance = 0;
  for (std::size_t k = 0; k <= degree; ++k) {
    const Polynomial& p = kPolynomials[k];
    const double share = std::inner_product(rest.begin(), rest.end(), p.values.begin(), 0.0);
    for (std::size_t t = 0; t < kSamples; ++t) rest[t] -= share * p.values[t];
    start.slope.value += share * p.slope;
    variance += p.slope * p.slope;
  }
  const double squares = std::inner_product(rest.begin(), rest.end(), rest.begin(), 0.0);
  start.scatter = std::sqrt(squares / static_cast<double>(kSamples - degree - 1));
  start.slope.sigma = start.scatter * std::sqrt(variance);
  return start;
}

// Over a few samples, so that noise does not pass for speed.
double peak_speed_m_s(std::span<const double> position_m, double dt_s) {
  double peak = 0;
  for (std::size_t i = kSamples; i < position_m.size(); ++i) {
    peak = std::max(peak, std::abs(position_m[i] - position_m[i - kSamples]) / (kSamples * dt_s));
  }
  return peak;
}

}  // namespace

std::optional<std::string> motion_at_start(const control::Recording& recording,
                                           std::span<const double> recorded_velocity_m_s) {
  const bool has_position = !recording.position_m.empty();
  const bool is_measured = recording.acceleration_m_s2.empty();
  const std::span<const double> velocity_m_s = is_measured ? recording.velocity_m_s : recorded_velocity_m_s;
  const std::span<const double> channel = has_position ? recording.position_m : velocity_m_s;
  if (channel.size() < 2 * kSamples) return std::nullopt;
  const auto first = channel.first(kSamples);
  const bool coasts = std::ranges::all_of(std::span{recording.duty}.first(kSamples), [](double u) { return u == 0; });
  Estimate speed;
  double peak_m_s = 0;
  if (has_position) {
    const Estimate slope = start_of(first, coasts ? 2 : 3).slope;
    speed = {slope.value / recording.dt_s, slope.sigma / recording.dt_s};
    peak_m_s = peak_speed_m_s(channel, recording.dt_s);
  } else {
    speed = {channel.front(), start_of(first, 3).scatter};
    for (const double v : channel) peak_m_s = std::max(peak_m_s, std::abs(v));
  }
  const double least_m_s =
      std::max({control::kSlowestMotionM_S, kSigmas * speed.sigma, (coasts ? kOfPeakCoasting : kOfPeak) * peak_m_s});
  if (!(std::abs(speed.value) > least_m_s)) return std::nullopt;
  return fmt::format(
      "the recording begins in motion, at about {:.2g} m/s; the model assumes rest before the first sample, so its "
      "parameters may be wrong: begin the recording or the window at rest",
      speed.value);
}

}  // namespace server::analysis
