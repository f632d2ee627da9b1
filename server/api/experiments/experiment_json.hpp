// Experiments as JSON, and the bodies of requests about them.
#pragma once

#include <string>

#include "server/api/bodies/json.hpp"
#include "server/experiments/runner/experiments.hpp"

namespace server::api {

// With the counts of its runs: of lists, of the answer to keep-alive, and on /live.
nlohmann::json summary_json(const experiments::ExperimentView& view);
nlohmann::json to_json(const experiments::ExperimentView& view);  // the same with its runs

// e.g. {"robot_id":"sim-1","profile":"figure_7"}; a profile is the name of a shipped one, a document in TOML, or one as
// a JSON object. not_found for a name that is none.
Result<storage::ExperimentRequest> parse_experiment(const std::string& text);

Result<std::optional<std::int64_t>> parse_keep_alive(const std::string& text);  // {"stamp_us": …}; or nothing
Result<std::string> parse_abort(const std::string& text);                       // the reason; an empty body has none

struct MoveBody {
  storage::ExperimentId before = 0;  // 0: to the end
  std::int64_t priority = 0;
};
Result<MoveBody> parse_move(const std::string& text);

}  // namespace server::api
