// The body of POST /api/v1/jobs: which computation, on which runs.
#pragma once

#include <optional>
#include <string>

#include "server/analysis/documents/document_jobs.hpp"
#include "server/analysis/identify_job.hpp"
#include "server/api/bodies/json.hpp"
#include "server/storage/jobs/job.hpp"

namespace server::api {

struct JobBody {
  std::string kind;
  analysis::IdentifyRequest identify;
  std::optional<analysis::DocumentRequest> document_request;  // of report, comparison and export
  std::string document;                                       // the body, as it is kept
};

// e.g. {"kind":"identify","run_id":12,"from_s":0,"to_s":60,"structure":"fractional","validation_run_id":13}
Result<JobBody> parse_job(const std::string& text);

nlohmann::json to_json(const storage::Job& job);

}  // namespace server::api
