// What each kind makes, and the file that it may leave.
#include "server/analysis/documents/document_jobs.hpp"

#include <fmt/format.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "server/analysis/comparison/aligned_runs_json.hpp"

namespace server::analysis {
namespace asio = boost::asio;
using nlohmann::ordered_json;

namespace {

Watch watch_of(storage::JobRun& run) {
  return [&run](double share, const std::string& stage) {
    run.report(share, stage);
    return !run.is_cancelled();
  };
}

asio::awaitable<Result<std::string>> compare(DocumentJobParts parts, ComparisonRequest request, storage::JobRun& run) {
  auto metrics = co_await parts.documents.comparison(request.runs);
  if (!metrics) co_return std::unexpected{metrics.error()};
  auto traces = co_await parts.documents.traces_json(request.runs, std::move(request.traces), watch_of(run));
  if (!traces) co_return std::unexpected{traces.error()};
  co_return fmt::format(R"({{"metrics":{},"traces":{}}})", metrics->dump(), *traces);
}

asio::awaitable<Result<std::string>> html_for(RunDocuments& documents, ReportRequest request, storage::JobRun& run) {
  if (request.runs.size() > 1) {
    co_return co_await documents.comparison_report(request.runs, std::move(request.traces), watch_of(run));
  }
  run.report(0, fmt::format("run {}", request.runs.front()));
  co_return co_await documents.report(request.runs.front());
}

void write_draft(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file{path, std::ios::binary};
  if (!(file << text && file.flush())) throw std::runtime_error{"the report cannot be written"};
}

asio::awaitable<Result<void>> write_report(DocumentJobParts parts, ReportRequest request, storage::JobRun& run) {
  auto html = co_await html_for(parts.documents, std::move(request), run);
  if (!html) co_return std::unexpected{html.error()};
  const std::filesystem::path path = co_await parts.exports.files.begin_draft(run.id());
  auto write = [path, html = std::move(*html)] { write_draft(path, html); };
  co_await parts.exports.exports.reader().run(std::move(write));
  co_return Result<void>{};
}

// Whole or not at all: nothing is left of a job that failed or was cancelled.
asio::awaitable<Result<std::string>> keep(DocumentJobParts parts, Result<void> written, const char* ending,
                                          storage::JobRun& run) {
  storage::JobFiles& files = parts.exports.files;
  Result<storage::JobFile> file;
  if (written && !run.is_cancelled()) file = co_await files.finish(run.id(), ending);
  if (!written || run.is_cancelled() || !file) {
    co_await files.remove(run.id());
    if (!written) co_return std::unexpected{written.error()};
    if (!file) co_return std::unexpected{file.error()};
    co_return fail(ErrorCode::conflict, "cancelled");
  }
  const ordered_json result{{"file", fmt::format("job-{}.{}", run.id(), ending)},
                            {"size_bytes", file->size_bytes},
                            {"kept_until_us", file->kept_until_us()},
                            {"path", fmt::format("/api/v1/jobs/{}/file", run.id())}};
  co_return result.dump();
}

}  // namespace

std::vector<storage::RunId> runs_of(const DocumentRequest& request) {
  if (const auto* report = std::get_if<ReportRequest>(&request)) return report->runs;
  if (const auto* comparison = std::get_if<ComparisonRequest>(&request)) return comparison->runs;
  return {std::get<ExportRequest>(request).query.run};
}

asio::awaitable<Result<std::string>> document_job(DocumentJobParts parts, DocumentRequest request,
                                                  storage::JobRun& run) {
  if (auto* comparison = std::get_if<ComparisonRequest>(&request)) {
    co_return co_await compare(parts, std::move(*comparison), run);
  }
  if (auto* report = std::get_if<ReportRequest>(&request)) {
    Result<void> written = co_await write_report(parts, std::move(*report), run);
    co_return co_await keep(parts, std::move(written), "html", run);
  }
  const auto wanted = std::get<ExportRequest>(request);
  Result<void> written = co_await write_export(parts.exports, wanted, run);
  co_return co_await keep(parts, std::move(written), text(wanted.format), run);
}

}  // namespace server::analysis
