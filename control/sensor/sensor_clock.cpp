// A periodogram over the ages of the readings, then a scan of the moments at which a new sample is there.
#include "control/sensor/sensor_clock.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

namespace control {
namespace {

using Eigen::Index;
using std::numbers::pi;

constexpr Index kPiece = 10;
constexpr std::size_t kMostPieces = 300;
constexpr double kLeastAge = -0.5, kMostAge = 2.5, kAgeStep = 1.0 / 40;  // in ticks
constexpr double kUsualAge = 0.7;                                        // in ticks, to see where ages show
constexpr double kSharpestAge = 0.15;  // in ticks, sd of the age of a piece that counts
constexpr double kClockError = 0.01;   // the largest, relative
constexpr double kLimit = 25;          // of a squared residual, in variances
constexpr double kNewButEqual = 2.2;   // -2 ln of the chance that a new reading equals the last
constexpr double kFinestOrder = 1e-3;  // in ticks

struct Piece {
  double age_s, at_s, weight;
};

double between_ticks(const Eigen::VectorXd& f, double place) {
  const Index before = std::clamp<Index>(static_cast<Index>(std::floor(place)), 0, f.size() - 2);
  return place < 0 ? 0 : f[before] + (place - static_cast<double>(before)) * (f[before + 1] - f[before]);
}

double squares(const ClockEvidence& e, Index first, double age_ticks) {
  double sum = 0;
  for (Index k = first; k < first + kPiece; ++k) {
    const double r = e.reading_m_s2[k] - between_ticks(e.expected_m_s2, static_cast<double>(k) - age_ticks);
    sum += r * r;
  }
  return sum;
}

// The weight is the information on the age, in 1/s².
std::vector<Piece> informative_pieces(const ClockEvidence& e) {
  std::vector<Piece> pieces;
  const double least = 1 / std::pow(kSharpestAge * e.dt_s, 2);
  for (Index first = kPiece; first + kPiece <= e.reading_m_s2.size(); first += kPiece) {
    double weight = 0;
    for (Index k = first; k < first + kPiece; ++k) {
      const double place = static_cast<double>(k) - kUsualAge;
      const double slope = between_ticks(e.expected_m_s2, place + 0.5) - between_ticks(e.expected_m_s2, place - 0.5);
      weight += std::pow(slope / e.dt_s / e.sd_m_s2, 2);
    }
    if (weight < least) continue;
    if (e.is_stopped()) return {};
    double best = std::numeric_limits<double>::infinity(), age = 0;
    for (double tried = kLeastAge; tried <= kMostAge; tried += kAgeStep) {
      const double found = squares(e, first, tried);
      if (found < best) best = found, age = tried;
    }
    const Index middle = first + kPiece / 2;
    pieces.push_back({age * e.dt_s, e.dt_s * static_cast<double>(middle), weight});
  }
  std::ranges::sort(pieces, std::ranges::greater{}, &Piece::weight);
  if (pieces.size() > kMostPieces) pieces.resize(kMostPieces);
  return pieces;
}

std::complex<double> agreement(const std::vector<Piece>& pieces, double period_s) {
  std::complex<double> sum = 0;
  for (const Piece& piece : pieces) {
    sum += piece.weight * std::polar(1.0, 2 * pi * (piece.age_s - piece.at_s) / period_s);
  }
  return sum;
}

// (2)
class OrderCost {
 public:
  OrderCost(const ClockEvidence& evidence, const SensorTiming& timing) : e_(evidence), timing_(timing) {
    const Index samples = e_.reading_m_s2.size();
    is_informative_.resize(static_cast<std::size_t>(samples));
    for (Index k = 1; k + 1 < samples; ++k) {
      const double step = std::max(std::abs(e_.expected_m_s2[k] - e_.expected_m_s2[k - 1]),
                                   k < 2 ? 0 : std::abs(e_.expected_m_s2[k - 1] - e_.expected_m_s2[k - 2]));
      is_informative_[static_cast<std::size_t>(k)] = step > e_.sd_m_s2;
    }
  }

  double operator()(const ReadOrder& order) const {
    const double variance = e_.sd_m_s2 * e_.sd_m_s2;
    double sum = 0, last = -1e18;
    for (std::size_t k = 0; k < is_informative_.size(); ++k) {
      const double number =
          std::floor((e_.dt_s * static_cast<double>(k) - order.first_available_s) / order.period_s + 1e-9);
      const bool is_read_again = number == last;
      last = number;
      if (is_read_again) {
        sum += variance * (e_.is_repeated[k] ? -kNewButEqual : kLimit);
      } else if (is_informative_[k]) {
        const double place = (timing_.first_s + timing_.period_s * number) / e_.dt_s;
        const double r = e_.reading_m_s2[static_cast<Index>(k)] - between_ticks(e_.expected_m_s2, place);
        sum += std::min(r * r, kLimit * variance);
      }
    }
    return sum;
  }

 private:
  const ClockEvidence& e_;
  const SensorTiming& timing_;
  std::vector<bool> is_informative_;
};

}  // namespace

std::optional<SensorClock> find_clock(const ClockEvidence& e, double time_constant_s) {
  const std::vector<Piece> pieces = informative_pieces(e);
  if (pieces.size() < 8) return std::nullopt;
  const double duration_s = e.dt_s * static_cast<double>(e.reading_m_s2.size());
  SensorClock clock{{0, e.dt_s, time_constant_s}, {0, e.dt_s}};
  double best = 0;
  for (double error = -kClockError; error <= kClockError; error += e.dt_s / duration_s / 8) {
    if (e.is_stopped()) return std::nullopt;
    const double period_s = e.dt_s * (1 + error);
    const std::complex<double> sum = agreement(pieces, period_s);
    if (std::abs(sum) <= best) continue;
    best = std::abs(sum);
    clock.timing.period_s = clock.order.period_s = period_s;
    clock.timing.first_s = -period_s * std::arg(sum) / (2 * pi);
  }
  double weight = 0, age_s = 0;
  for (const Piece& piece : pieces) weight += piece.weight, age_s += piece.weight * piece.age_s;
  const double lag_s = age_s / weight - e.dt_s / 2;
  const OrderCost cost(e, clock.timing);
  double lowest = std::numeric_limits<double>::infinity();
  for (double shift = -0.6; shift <= 0.6; shift += 0.05) {
    if (e.is_stopped()) return std::nullopt;
    const ReadOrder tried{clock.timing.first_s + lag_s + shift * e.dt_s, clock.timing.period_s};
    const double found = cost(tried);
    if (found < lowest) lowest = found, clock.order = tried;
  }
  return clock;
}

// First the moment, in fine steps, then moment and period together, turned about the middle of the record.
ReadOrder find_order(const ClockEvidence& e, const SensorTiming& timing, const ReadOrder& near, double range_s) {
  constexpr int kPeriods = 20, kMoments = 3;
  const OrderCost cost(e, timing);
  const double samples = static_cast<double>(e.reading_m_s2.size());
  const double middle = std::floor((e.dt_s * samples / 2 - near.first_available_s) / timing.period_s);
  const double from_s = near.first_available_s + middle * (near.period_s - timing.period_s);
  const double step_s = std::max(kFinestOrder * e.dt_s, range_s / 100), finer_s = 4 * kFinestOrder * e.dt_s / samples;
  const auto at = [&](double shift_s, double more_s) {
    return ReadOrder{from_s + shift_s - middle * more_s, timing.period_s + more_s};
  };
  double lowest = std::numeric_limits<double>::infinity(), best_s = 0;
  for (double shift_s = -range_s; shift_s <= range_s; shift_s += step_s) {
    if (e.is_stopped()) return at(best_s, 0);
    const double found = cost(at(shift_s, 0));
    if (found < lowest) lowest = found, best_s = shift_s;
  }
  ReadOrder best = at(best_s, 0);
  for (int p = -kPeriods; p <= kPeriods; ++p) {
    for (int m = -kMoments; m <= kMoments; ++m) {
      if (e.is_stopped()) return best;
      const ReadOrder tried = at(best_s + m * step_s, p * finer_s);
      const double found = cost(tried);
      if (found < lowest) lowest = found, best = tried;
    }
  }
  return best;
}

}  // namespace control
