// Takes what plots and comparisons need out of stored samples.
#include "server/analysis/comparison/trace.hpp"

#include <limits>

namespace server::analysis {

TracePoint trace_point(const storage::StoredSample& stored) {
  TracePoint point;
  point.span = stored.span;
  point.seq = stored.seq;
  point.robot_time_us = stored.robot_time_us;
  point.utc_us = stored.utc_us;
  point.position_m = stored.sample.position_m;
  point.position_sd_m = station::or_nan(stored.position_sd_m);
  point.velocity_m_s = stored.sample.velocity_m_s;
  point.acceleration_m_s2 = stored.sample.acceleration_m_s2;
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  const bool is_steered = stored.mode == rheonaut_MODE_AUTO && stored.setpoint_m.has_value();
  point.setpoint_m = is_steered ? *stored.setpoint_m : nothing;
  point.reference_m = is_steered ? stored.sample.reference_m : nothing;
  point.disturbance_m = station::or_nan(stored.disturbance_m);
  point.duty = stored.sample.duty;
  point.impedance_mv = stored.sample.impedance_mv;
  point.is_manual = stored.mode == rheonaut_MODE_MANUAL;
  return point;
}

std::vector<double> times_of(std::span<const TracePoint> points) {
  std::vector<double> times_s;
  times_s.reserve(points.size());
  double span_begins_s = 0;
  std::uint64_t span_began_us = points.empty() ? 0 : points.front().robot_time_us;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i > 0 && points[i].span != points[i - 1].span) {
      span_begins_s = 1e-6 * static_cast<double>(points[i].utc_us - points.front().utc_us);
      span_began_us = points[i].robot_time_us;
    }
    times_s.push_back(span_begins_s + 1e-6 * static_cast<double>(points[i].robot_time_us - span_began_us));
  }
  return times_s;
}

bool follows(const TracePoint& before, const TracePoint& after) {
  return before.span == after.span && after.seq == before.seq + 1;
}

}  // namespace server::analysis
