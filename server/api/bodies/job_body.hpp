// The body of POST /api/v1/jobs: which computation, on which runs or models.
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "server/analysis/documents/document_jobs.hpp"
#include "server/analysis/identify_job.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/tune_body.hpp"
#include "server/storage/jobs/job.hpp"

namespace server::api {

struct JobBody {
  std::string kind;
  std::variant<analysis::IdentifyRequest, TuneBody, TuningMapBody, analysis::MeasuredTuneRequest,
               analysis::DocumentRequest>
      request;
  std::string document;  // the body, as it is kept
};

// e.g. {"kind":"identify","run_id":12,"from_s":0,"to_s":60,"structure":"fractional","validation_run_id":13}
Result<JobBody> parse_job(const std::string& text);

nlohmann::json to_json(const storage::Job& job);

}  // namespace server::api
