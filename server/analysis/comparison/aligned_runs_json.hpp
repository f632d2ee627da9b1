// Aligned runs as JSON: one array for the time, one for each trace and each difference; null where there is nothing.
#pragma once

#include <nlohmann/json.hpp>

#include "server/analysis/comparison/aligned_runs.hpp"

namespace server::analysis {

nlohmann::ordered_json json_of(const Alignment& alignment);
nlohmann::ordered_json json_of(const AlignedRuns& aligned);

}  // namespace server::analysis
