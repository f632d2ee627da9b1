// The body of POST …/fluids/{fluid}/model: the model that `rheonaut estimator --json` prints.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/runtime/result.hpp"
#include "server/station/state/fluid_model.hpp"

namespace server::api {

// Refuses what a robot would refuse, and a fit error above kMaxModelFitError. Author and time are left empty.
Result<station::FluidModel> parse_fluid_model(const std::string& body);

// As it came, with its numbers as robots get them, and who gave it when.
nlohmann::json to_json(const station::FluidModel& model);

}  // namespace server::api
