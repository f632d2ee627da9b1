// Looks at the largest duty, the largest speed, the way and the step of time.
#include "control/identification/unit_doubts.hpp"

#include <algorithm>
#include <cmath>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

constexpr double kFastestM_S = 5, kLargestAcceleration_m_s2 = 50;
constexpr double kLongestStepS = 0.9, kLongestWayM = 20;
constexpr std::size_t kSteps = 10;  // over which a speed is taken, so that noise is none

double largest(const std::vector<double>& values) {
  double found = 0;
  for (const double value : values) found = std::max(found, std::abs(value));
  return found;
}

double span(const std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto [least, most] = std::ranges::minmax(values);
  return most - least;
}

double fastest_m_s(const Recording& recording) {
  const std::vector<double>&x = recording.position_m, &t = recording.position_time_s;
  double found = 0;
  for (std::size_t k = kSteps; k < x.size(); ++k) {
    const double time_s = t.empty() ? recording.dt_s * static_cast<double>(kSteps) : t[k] - t[k - kSteps];
    found = std::max(found, std::abs(x[k] - x[k - kSteps]) / time_s);
  }
  return found;
}

}  // namespace

std::vector<std::string> unit_doubts(const Recording& recording) {
  std::vector<std::string> doubts;
  const auto add = [&](const auto&... parts) { doubts.push_back(base::join_text(parts...)); };
  if (const double duty = largest(recording.duty); duty > 1) {
    add("duty reaches ", duty, ", and is from -1 to 1: if it is in percent, divide it by 100; kp is per unit of it");
  }
  if (recording.dt_s >= kLongestStepS) {
    add("t_s steps by ", recording.dt_s, " s, which is slow for a swimming robot: if it is in ms, divide it by 1000");
  }
  if (const double speed_m_s = fastest_m_s(recording); speed_m_s > kFastestM_S) {
    add("position_m moves at up to ", speed_m_s,
        " m/s, which is fast for a swimming robot: if it is in mm, divide it by ", "1000");
  } else if (const double span_m = span(recording.position_m); span_m > kLongestWayM) {
    add("position_m spans ", span_m, " m, which is far for a swimming robot: if it is in mm, divide it by 1000");
  }
  if (const double speed_m_s = largest(recording.velocity_m_s); speed_m_s > kFastestM_S) {
    add("velocity_m_s reaches ", speed_m_s, " m/s, which is fast for a swimming robot: if it is in mm/s, divide it by ",
        "1000");
  }
  if (const double a = largest(recording.acceleration_m_s2); a > kLargestAcceleration_m_s2) {
    add("acceleration_m_s2 reaches ", a, " m/s², which is much for a swimming robot: if it is in mm/s², divide it by ",
        "1000");
  }
  return doubts;
}

}  // namespace control
