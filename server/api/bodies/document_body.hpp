// What documents about runs are asked for: as the query of a route, or as the body of a job.
#pragma once

#include <vector>

#include "server/analysis/documents/document_jobs.hpp"
#include "server/api/bodies/json.hpp"
#include "server/http/http.hpp"

namespace server::api {

// `runs`: numbers with commas between them, e.g. runs=1,2.
Result<std::vector<storage::RunId>> query_runs(const http::Request& request, std::size_t least, std::size_t most);

// `bin_mm`, in metres.
Result<double> query_bin_m(const http::Request& request);

// at, number, event, marker, grid_us, from_ms, to_ms, reference_run_id and, where the route has it, channels; of these
// runs.
Result<analysis::TracesRequest> query_traces(const http::Request& request, const std::vector<storage::RunId>& runs);

// The names of these parameters, with `runs`.
std::vector<std::string> traces_parameters();
std::vector<std::string> traces_parameters_and_channels();

// The body of a job `report`, `comparison` or `export`, e.g. {"kind":"comparison","runs":[1,2],"traces":{"at":"step"}}.
Result<analysis::DocumentRequest> parse_document_job(const std::string& kind, const Members& body);

}  // namespace server::api
