// The bodies of POST …/fluids/{fluid}/model, which is the model that `rheonaut estimator --json` prints, and of
// POST …/robots/{robot_id}/model, which names the fluid beside it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/runtime/result.hpp"
#include "server/station/state/fluid_model.hpp"

namespace server::api {

// Refuses what a robot would refuse, and a fit error above kMaxModelFitError. Author and time are left empty.
Result<station::FluidModel> parse_fluid_model(const std::string& body);

struct OwnModelBody {
  std::string fluid;  // as it was written
  station::FluidModel model;
};
Result<OwnModelBody> parse_own_model(const std::string& body);

// As it came, with its numbers as robots get them, and who gave it when.
nlohmann::json to_json(const station::FluidModel& model);

}  // namespace server::api
