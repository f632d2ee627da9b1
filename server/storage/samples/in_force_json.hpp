// What a robot reports to be in force as JSON: as it is stored, and as the API shows a controller.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/station/state/station_state.hpp"

namespace server::storage {

// "parameters" or "controller".
const char* kind_of(const station::InForceContent& content);
// Of parameters {"name": {"value", "unit", "minimum", "maximum", "default"}}, of a controller as below.
std::string document_text(const station::InForceContent& content);

// Coefficients as they were sent, in the order of the message.
nlohmann::json controller_json(const protocol::Controller& controller);

}  // namespace server::storage
