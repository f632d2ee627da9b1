// The samples of a run as they are plotted and compared.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/storage/samples/stored_sample.hpp"

namespace server::analysis {

// What is not a number is NaN.
struct TracePoint {
  std::uint32_t span = 0;
  std::uint64_t seq = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_us = 0;
  float position_m = 0;  // with the disturbance, as the robot's controller sees it
  float position_sd_m = 0;
  float velocity_m_s = 0;
  float acceleration_m_s2 = 0;
  float setpoint_m = 0;   // in auto mode
  float reference_m = 0;  // in auto mode
  float disturbance_m = 0;
  float duty = 0;
  float impedance_mv = 0;
  bool is_manual = false;
};
TracePoint trace_point(const storage::StoredSample& stored);

// Seconds since the first sample, of each: robot time within a span, UTC from one span to the next.
std::vector<double> times_of(std::span<const TracePoint> points);

// Whether no sample is missing between the two.
bool follows(const TracePoint& before, const TracePoint& after);

}  // namespace server::analysis
