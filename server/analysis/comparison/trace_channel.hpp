// The channels of which traces can be compared, by their names.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "server/analysis/comparison/trace.hpp"
#include "server/runtime/result.hpp"

namespace server::analysis {

struct TraceChannel {
  const char* name;  // as in telemetry, with its unit
  float TracePoint::* member;
  bool holds = false;  // keeps its value from one sample to the next; else it changes in a straight line
};

inline constexpr std::array kTraceChannels{
    TraceChannel{"position_m", &TracePoint::position_m},
    TraceChannel{"velocity_m_s", &TracePoint::velocity_m_s},
    TraceChannel{"acceleration_m_s2", &TracePoint::acceleration_m_s2},
    TraceChannel{"duty", &TracePoint::duty, true},
    TraceChannel{"impedance_mv", &TracePoint::impedance_mv},
    TraceChannel{"setpoint_m", &TracePoint::setpoint_m, true},
    TraceChannel{"reference_m", &TracePoint::reference_m, true},
    TraceChannel{"disturbance_m", &TracePoint::disturbance_m, true},
};
using TraceChannels = std::vector<const TraceChannel*>;

inline constexpr const char* kPositionChannel = "position_m";
inline constexpr const char* kUsualChannels = "position_m,duty";

// Names with commas between them, each once. invalid: another name, with those that there are.
Result<TraceChannels> parse_trace_channels(const std::string& text);

}  // namespace server::analysis
