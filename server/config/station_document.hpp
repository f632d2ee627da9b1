// The part of the configuration that affects robots, as JSON: each run stores it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/config/config.hpp"

namespace server::config {

// Equal for equal configurations; its version is the program's.
std::string station_document(const Config& config);

// By their names in the configuration.
nlohmann::json limits_json(const CommandLimits& limits);

}  // namespace server::config
