// Limits and link times by their names in the configuration file.
#include "server/station_document.hpp"

#include <nlohmann/json.hpp>

namespace server {

std::string station_document(const Config& config) {
  nlohmann::json out;
  out["version"] = RHEONAUT_VERSION;
  out["limits"] = {{"setpoint_min_m", config.limits.setpoint_min_m},
                   {"setpoint_max_m", config.limits.setpoint_max_m},
                   {"duty_min", config.limits.duty_min},
                   {"duty_max", config.limits.duty_max},
                   {"disturbance_max_m", config.limits.disturbance_max_m}};
  out["robots"] = {{"link_timeout_ms", config.link.link_timeout_ms},
                   {"heartbeat_interval_ms", config.link.heartbeat_interval_ms},
                   {"samples_per_frame", config.link.samples_per_frame}};
  return out.dump();
}

}  // namespace server
