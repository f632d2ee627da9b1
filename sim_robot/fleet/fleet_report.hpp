// What a fleet prints for people and scripts: a line of rates each second, and a summary with the result at its end.
//
// The fields are those of docs/fleet.md, with the same names in text and JSON.
#pragma once

#include <optional>
#include <string>

#include "sim_robot/fleet/fleet.hpp"

namespace sim_robot {

// A fleet at one moment; durations and CPU since its start.
struct FleetSnapshot {
  double time_s = 0;
  double cpu_s = 0;  // of this process, user and system
  FleetCounts counts;
  std::uint64_t unsettled = 0;  // samples made before the end and neither acknowledged nor lost some time after it
  const Lateness* acknowledged_after = nullptr;  // replay only: how long the station took
};

double process_cpu_s();

// The rates between two moments, per second.
std::string rates_text(const FleetSnapshot& from, const FleetSnapshot& to, const Lateness& lateness);
std::string rates_json(const FleetSnapshot& from, const FleetSnapshot& to, const Lateness& lateness);

// `fault`: see fleet_fault(); empty when there is none.
std::string summary_text(const FleetSnapshot& end, const Lateness& lateness, const std::string& fault);
std::string summary_json(const FleetSnapshot& end, const Lateness& lateness, const std::string& fault);

struct FleetFault {
  int exit_status = 1;  // 2 when no robot was ever admitted
  std::string reason;
};
// Empty when every robot was admitted, no sample is lost or unsettled, and at most 5 % of the ticks were skipped.
std::optional<FleetFault> fleet_fault(const FleetSnapshot& end);

}  // namespace sim_robot
