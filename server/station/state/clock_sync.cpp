// Bounds the drift by pairs of exchanges and picks the best exchange of the window.
#include "server/station/state/clock_sync.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace server::station {
namespace {

// Times of a robot that cannot be make no sum that overflows: no drift above 1, no uncertainty above 30 years.
constexpr double kMostDriftPpm = 1e6;
constexpr double kMostUncertaintyUs = 1e15;

}  // namespace

std::int64_t ClockEstimate::uncertainty_us(std::uint64_t robot_time_us) const {
  const auto age_us = std::abs(static_cast<std::int64_t>(robot_time_us - measured_at_robot_us));
  const double grown_us = std::ceil(static_cast<double>(age_us) * most_drift_ppm * 1e-6);
  return static_cast<std::int64_t>(std::min(static_cast<double>(bound_us) + grown_us, kMostUncertaintyUs));
}

void ClockSync::add(const ClockExchange& exchange) {
  const std::int64_t held_us = exchange.answered_at_robot_us - exchange.received_at_robot_us;
  const std::int64_t round_trip_us = exchange.answer_received_at_us - exchange.sent_at_us - held_us;
  if (held_us < 0 || round_trip_us < 0 || exchange.received_at_robot_us < 0) return;

  Measurement newest;
  newest.received_at_robot_us = exchange.received_at_robot_us;
  newest.answered_at_robot_us = exchange.answered_at_robot_us;
  newest.least_offset_us = exchange.sent_at_us - exchange.received_at_robot_us - 1;  // stamps are whole microseconds
  newest.most_offset_us = exchange.answer_received_at_us - exchange.answered_at_robot_us + 1;
  for (const Measurement& before : measurements_) newest.drift = newest.drift.within(drift_between(before, newest));
  measurements_.push_back(newest);
  if (measurements_.size() > kWindow) measurements_.pop_front();

  estimate_.valid = true;
  estimate_.round_trip_us = round_trip_us;
  measure_drift();
  choose_offset();
}

ClockSync::DriftRange ClockSync::DriftRange::within(const DriftRange& other) const {
  return {std::max(least_ppm, other.least_ppm), std::min(most_ppm, other.most_ppm)};
}

// (3), and as much more as the drift may have moved since.
ClockSync::DriftRange ClockSync::drift_between(const Measurement& before, const Measurement& after) {
  const std::int64_t inner_us = after.received_at_robot_us - before.answered_at_robot_us;
  const std::int64_t outer_us = after.answered_at_robot_us - before.received_at_robot_us;
  if (inner_us <= 0) return {};  // one that overtook the other
  const auto least_us = static_cast<double>(after.least_offset_us - before.most_offset_us);
  const auto most_us = static_cast<double>(after.most_offset_us - before.least_offset_us);
  return {least_us / static_cast<double>(inner_us) * 1e6 - kWanderPpm,
          most_us / static_cast<double>(outer_us) * 1e6 + kWanderPpm};
}

void ClockSync::measure_drift() {
  DriftRange measured;
  for (const Measurement& measurement : measurements_) measured = measured.within(measurement.drift);
  if (measured.is_empty()) {
    measurements_.erase(measurements_.begin(), measurements_.end() - 1);
    measurements_.back().drift = measured = {};
  }
  // A clock that is slow by 1000 ppm loses a little more than 1000 us in a second of its own.
  constexpr double kMostPpm = kPromisedDriftPpm / (1 - kPromisedDriftPpm * 1e-6);
  const DriftRange promised = measured.within({-kMostPpm, kMostPpm});
  const DriftRange drift = promised.is_empty() ? measured : promised;  // a clock that is worse than promised
  const double middle_ppm = (measured.least_ppm + measured.most_ppm) / 2;
  estimate_.drift_ppm = measurements_.size() < kLeastForDrift || !std::isfinite(middle_ppm) ? 0 : middle_ppm;
  const double most_ppm = std::max(std::abs(drift.least_ppm), std::abs(drift.most_ppm));
  estimate_.most_drift_ppm = std::clamp(most_ppm, kLeastGrowthPpm, kMostDriftPpm);
}

void ClockSync::choose_offset() {
  const std::int64_t now_us = measurements_.back().answered_at_robot_us;
  const double growth = estimate_.most_drift_ppm * 1e-6;
  // (2), valid at t3, to which the lower bound is carried from t2; grown with its age.
  const auto bound_us = [growth](const Measurement& measurement) {
    const std::int64_t held_us = measurement.answered_at_robot_us - measurement.received_at_robot_us;
    const std::int64_t width_us = measurement.most_offset_us - measurement.least_offset_us;
    return (width_us + 1) / 2 + static_cast<std::int64_t>(std::ceil(static_cast<double>(held_us) * growth));
  };
  const auto now_bound_us = [&](const Measurement& measurement) {
    const auto age_us = static_cast<double>(now_us - measurement.answered_at_robot_us);
    return static_cast<double>(bound_us(measurement)) + age_us * growth;
  };
  const auto by_bound = [&](const Measurement& a, const Measurement& b) { return now_bound_us(a) < now_bound_us(b); };
  const Measurement best = *std::min_element(measurements_.begin(), measurements_.end(), by_bound);
  estimate_.offset_us = best.least_offset_us + (best.most_offset_us - best.least_offset_us) / 2;
  estimate_.bound_us = bound_us(best);
  estimate_.measured_at_robot_us = static_cast<std::uint64_t>(best.answered_at_robot_us);
}

}  // namespace server::station
