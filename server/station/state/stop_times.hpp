// Durations of emergency stops since the start of the program: from the request's arrival at the station until its
// frame was sent, until the robot answered that it had obeyed, and until telemetry showed duty 0. Only stops of
// connected robots count: a stop for an absent robot waits for its return.
#pragma once

#include "server/runtime/histogram.hpp"

namespace server::station {

struct StopTimes {
  runtime::TimeHistogram sent, acknowledged, verified;
};

}  // namespace server::station
