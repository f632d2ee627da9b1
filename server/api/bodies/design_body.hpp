// The body of POST /api/v1/designs, and a design as JSON.
#pragma once

#include <optional>
#include <string>

#include "server/api/bodies/json.hpp"
#include "server/storage/designs/design.hpp"
#include "server/storage/jobs/job.hpp"

namespace server::api {

// The document of the body is checked; with `job` it is that job's result, and not in the body.
struct DesignBody {
  storage::DesignRequest request;
  std::optional<storage::JobId> job;
};
Result<DesignBody> parse_design(const std::string& text);

nlohmann::json to_json(const storage::Design& design);  // without its document

}  // namespace server::api
