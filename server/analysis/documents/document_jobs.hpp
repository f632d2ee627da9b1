// The jobs `report`, `comparison` and `export`: documents about runs that take longer than a request may.
//
// The result of a comparison is JSON. That of a report or an export names a file that the station keeps for a while.
// Loop thread; what the jobs work with outlives them.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <string>
#include <variant>
#include <vector>

#include "server/analysis/documents/export_job.hpp"
#include "server/analysis/documents/run_documents.hpp"
#include "server/storage/jobs/job_files.hpp"
#include "server/storage/jobs/job_run.hpp"

namespace server::analysis {

struct ReportRequest {
  std::vector<storage::RunId> runs;  // one, or several that are compared
  TracesRequest traces;              // of several; its channels are those of the report
};

struct ComparisonRequest {
  std::vector<storage::RunId> runs;
  TracesRequest traces;
};

using DocumentRequest = std::variant<ReportRequest, ComparisonRequest, ExportRequest>;

std::vector<storage::RunId> runs_of(const DocumentRequest& request);

struct DocumentJobParts {
  RunDocuments& documents;
  ExportParts exports;
};

// {"metrics": …, "traces": …} of a comparison, else {"file", "size_bytes", "kept_until_us", "path"}.
boost::asio::awaitable<Result<std::string>> document_job(DocumentJobParts parts, DocumentRequest request,
                                                         storage::JobRun& run);

}  // namespace server::analysis
