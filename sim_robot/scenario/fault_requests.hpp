// The answers of the fault server, without HTTP.
#pragma once

#include <string>

#include "sim_robot/scenario/fault_timeline.hpp"

namespace sim_robot {

struct FaultRequest {
  std::string method, target;
  std::string host, content_type, origin;  // headers, empty when absent
  std::string body;
};

struct FaultAnswer {
  int status = 200;
  std::string body;  // JSON
};

FaultAnswer answer(const FaultRequest& request, FaultTimeline& faults, const FaultyRobot& robot);
// {"status":…,"reason":…,"detail":…}
FaultAnswer fault_problem(int status, const std::string& reason, const std::string& detail);

}  // namespace sim_robot
