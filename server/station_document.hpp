// The configuration that bears on what a robot does, as JSON: what a run keeps of its station.
#pragma once

#include <string>

#include "server/config.hpp"

namespace server {

// Equal for equal configurations; its version is the program's.
std::string station_document(const Config& config);

}  // namespace server
