// Picks the best exchange of the window and fits the drift.
#include "server/station/state/clock_sync.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace server::station {

std::int64_t ClockEstimate::uncertainty_us(std::uint64_t robot_time_us) const {
  const auto age_us = std::abs(static_cast<std::int64_t>(robot_time_us - measured_at_robot_us));
  return bound_us + static_cast<std::int64_t>(std::ceil(static_cast<double>(age_us) * kMaxDriftPpm * 1e-6));
}

void ClockSync::add(const ClockExchange& exchange) {
  const std::int64_t held_us = exchange.answered_at_robot_us - exchange.received_at_robot_us;
  const std::int64_t round_trip_us = exchange.answer_received_at_us - exchange.sent_at_us - held_us;
  if (held_us < 0 || round_trip_us < 0 || exchange.received_at_robot_us < 0) return;

  const std::int64_t sum_us = (exchange.sent_at_us - exchange.received_at_robot_us) +
                              (exchange.answer_received_at_us - exchange.answered_at_robot_us);
  measurements_.push_back({exchange.answer_received_at_us, static_cast<std::uint64_t>(exchange.answered_at_robot_us),
                           sum_us / 2, round_trip_us});
  if (measurements_.size() > kWindow) measurements_.pop_front();

  const std::int64_t now_us = exchange.answer_received_at_us;
  const auto bound_us = [now_us](const Measurement& measurement) {
    const auto age_us = static_cast<double>(now_us - measurement.at_us);
    return static_cast<double>(measurement.round_trip_us) / 2 + age_us * ClockEstimate::kMaxDriftPpm * 1e-6;
  };
  const auto by_bound = [&](const Measurement& a, const Measurement& b) { return bound_us(a) < bound_us(b); };
  const Measurement best = *std::min_element(measurements_.begin(), measurements_.end(), by_bound);
  estimate_.valid = true;
  estimate_.offset_us = best.offset_us;
  estimate_.bound_us = best.round_trip_us / 2 + 1;
  estimate_.measured_at_robot_us = best.robot_time_us;
  estimate_.drift_ppm = drift_ppm();
  estimate_.round_trip_us = round_trip_us;
}

// Between the quickest exchange of the older half and that of the newer half; 0 before there are 10 of them.
double ClockSync::drift_ppm() const {
  if (measurements_.size() < 10) return 0;
  const auto middle = measurements_.begin() + static_cast<std::ptrdiff_t>(measurements_.size() / 2);
  const auto by_round_trip = [](const Measurement& a, const Measurement& b) {
    return a.round_trip_us < b.round_trip_us;
  };
  const Measurement older = *std::min_element(measurements_.begin(), middle, by_round_trip);
  const Measurement newer = *std::min_element(middle, measurements_.end(), by_round_trip);
  const auto span_us = static_cast<double>(newer.at_us - older.at_us);
  return span_us <= 0 ? 0 : static_cast<double>(newer.offset_us - older.offset_us) / span_us * 1e6;
}

}  // namespace server::station
