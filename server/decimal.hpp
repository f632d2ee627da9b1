// Floats in JSON.
#pragma once

#include <nlohmann/json.hpp>

namespace server {

// A float as the shortest decimal that gives the same float back: 0.1, not 0.10000000149011612. null unless finite.
nlohmann::json decimal(float value);

}  // namespace server
