// The steps that were measured beside those that were predicted. Pure.
#pragma once

#include <iosfwd>
#include <nlohmann/json.hpp>

namespace server::cli {

// `metrics`: GET …/runs/{run_id}/metrics; `tuning`: the result of a job `tune`. A list of steps, each with `measured`
// and `predicted`; the latter is null for a step of another size than the prediction has.
nlohmann::json comparison_of(const nlohmann::json& metrics, const nlohmann::json& tuning);

void write_comparison(std::ostream& out, const nlohmann::json& steps);

}  // namespace server::cli
