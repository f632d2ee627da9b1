// What is known of a run beside its conditions, as JSON: its digest, and what was in force.
#pragma once

#include <nlohmann/json.hpp>

#include "server/storage/runs/run.hpp"
#include "server/storage/runs/run_digester.hpp"

namespace server::api {

nlohmann::json to_json(const storage::CurrentDigest& found, storage::RunId run);
nlohmann::json to_json(const storage::RunSnapshot& snapshot);

}  // namespace server::api
