// A run as an .eln archive: what is known of it gathered, then written in slices beside the recording.
#include <fmt/format.h>

#include "base/json_text.hpp"
#include "base/version.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/analysis/capsule/run_capsule.hpp"
#include "server/analysis/documents/run_documents.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/bodies/design_body.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/bodies/run_json.hpp"
#include "server/api/routes/csv_export.hpp"
#include "server/storage/designs/designs.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/runs.hpp"

namespace server::api {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

constexpr std::size_t kMostDesigns = 1000;  // of a run
constexpr const char* kJson = "application/json";

// A design that names the run, and those that it descends from.
struct DesignWithAncestors {
  storage::Design design;
  std::vector<storage::Design> ancestors;
};

struct RunPapers {
  storage::Run run;
  std::string report_html;
  storage::StoredMetrics metrics;
  storage::CurrentDigest digest;
  storage::RunSnapshot snapshot;
  std::vector<DesignWithAncestors> designs;
  std::vector<storage::ControllerOfRun> made_with;
  std::optional<storage::PerformedProfile> performed;
};

std::string pretty(const json& value) { return value.dump(2, ' ', false, json::error_handler_t::replace) + "\n"; }

json with_document(const storage::Design& design) {
  json out = to_json(design);
  out["document"] = json::parse(design.made.document, nullptr, false);
  return out;
}

std::string designs_text(const RunPapers& papers) {
  json list = json::array(), made_with = json::array();
  for (const DesignWithAncestors& one : papers.designs) {
    list.push_back(with_document(one.design));
    list.back()["ancestors"] = json::array();
    for (const storage::Design& ancestor : one.ancestors) list.back()["ancestors"].push_back(with_document(ancestor));
  }
  for (const storage::ControllerOfRun& one : papers.made_with) {
    made_with.push_back(with_document(one.controller));
    made_with.back()["model"] = one.model ? with_document(*one.model) : json(nullptr);
  }
  return pretty({{"designs", std::move(list)}, {"made_with", std::move(made_with)}});
}

std::string experiment_text(const storage::PerformedProfile& performed) {
  return pretty({{"experiment_id", performed.origin.experiment},
                 {"number", performed.origin.number},
                 {"variant", json::parse(performed.variant, nullptr, false)},
                 {"profile_sha256", performed.origin.profile_sha256},
                 {"profile", performed.document}});
}

std::string metrics_text(const storage::StoredMetrics& metrics) {
  json out = json::parse(metrics.document, nullptr, false);
  out["version"] = metrics.version;
  out["program"] = metrics.program;
  return pretty(out);
}

// Slow for long runs: on a worker.
std::vector<analysis::CapsuleDocument> documents_of(const RunPapers& papers) {
  const storage::Run& run = papers.run;
  std::vector<analysis::CapsuleDocument> documents{
      {"run.json", "Conditions and counts of the run", kJson, pretty(to_json(run))},
      {"metrics.json", "Figures and steps of the run", kJson, metrics_text(papers.metrics)},
      {"certificate.json", "Digest of the samples", kJson, pretty(to_json(papers.digest, run.id))},
      {"configuration.json", "Controller, parameters and station configuration in force", kJson,
       pretty(to_json(papers.snapshot))},
      {"designs.json",
       "Models and controllers found from the run, with their ancestry, and those that it was made with", kJson,
       designs_text(papers)},
      {"report.html", "Report with plots", "text/html", papers.report_html}};
  if (papers.performed) {
    documents.push_back({"experiment.json", "Number of the run in its experiment, and the profile that was performed",
                         kJson, experiment_text(*papers.performed)});
  }
  return documents;
}

asio::awaitable<std::vector<DesignWithAncestors>> designs_of(CapsuleRoutes parts, storage::RunId id) {
  storage::DesignFilter filter;
  filter.run = id;
  filter.limit = kMostDesigns;
  auto found = co_await parts.designs.list(filter);
  std::vector<DesignWithAncestors> designs;
  for (storage::Design& design : found) {
    auto ancestors = co_await parts.designs.ancestors(design.id);
    designs.push_back({std::move(design), std::move(ancestors)});
  }
  co_return designs;
}

// As of the end of the run, so that they are the same whenever the archive is made.
asio::awaitable<Result<RunPapers>> papers_of(CapsuleRoutes parts, storage::Run run) {
  RunPapers papers;
  auto metrics = co_await parts.documents.metrics(run.id);
  if (!metrics) co_return std::unexpected{metrics.error()};
  papers.metrics = std::move(metrics->metrics);
  auto report = co_await parts.documents.report(run.id, run.ended_at_us.value_or(run.started_at_us));
  if (!report) co_return std::unexpected{report.error()};
  papers.report_html = std::move(*report);
  auto digest = co_await parts.digester.find(run.id);
  if (!digest) co_return std::unexpected{digest.error()};
  papers.digest = std::move(*digest);
  auto snapshot = co_await parts.runs.snapshot(run.id);
  if (!snapshot) co_return std::unexpected{snapshot.error()};
  papers.snapshot = std::move(*snapshot);
  papers.designs = co_await designs_of(parts, run.id);
  papers.made_with = co_await parts.designs.controllers_of(run.id);
  papers.performed = co_await parts.runs.performed_profile(run.id);
  papers.run = std::move(run);
  papers.run.missed = metrics->run.missed;  // as the metrics have it
  co_return papers;
}

asio::awaitable<Result<storage::Run>> ended_run(CapsuleRoutes parts, storage::RunId id) {
  auto run = co_await parts.runs.find(id);
  if (!run) co_return std::unexpected{run.error()};
  if (run->state == storage::RunState::open) {
    co_return fail(ErrorCode::conflict, fmt::format("run {} is open; end it first", id), "run_is_open");
  }
  if (run->state == storage::RunState::discarded) {
    co_return fail(ErrorCode::conflict, fmt::format("run {} was discarded; its samples are not held", id), "discarded");
  }
  co_return run;
}

asio::awaitable<Result<analysis::CapsuleRequest>> capsule_of(CapsuleRoutes parts, storage::RunId id) {
  auto run = co_await ended_run(parts, id);
  if (!run) co_return std::unexpected{run.error()};
  co_await parts.exports.history.settle();  // events and commands that were received
  auto spans = co_await parts.exports.history.spans(storage::excerpt_of(id));
  if (!spans) co_return std::unexpected{spans.error()};
  for (storage::RecordedSpan& span : *spans) span.cut(span.made());
  auto papers = co_await papers_of(parts, *run);
  if (!papers) co_return std::unexpected{papers.error()};
  analysis::CapsuleRequest request;
  request.subject = {std::move(*run), base::version(), analysis::architecture()};
  request.spans = std::move(*spans);
  request.store = storage::reading_uri(parts.exports.database, false);
  auto write = [papers = std::move(*papers)] { return documents_of(papers); };
  request.documents = co_await parts.analysis.compute(std::move(write));
  co_return request;
}

http::Answer get_capsule(CapsuleRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  auto wanted = co_await capsule_of(parts, *id);
  if (!wanted) co_return http::problem(wanted.error());
  auto archive = co_await begin_export_file(parts.exports, wanted->spans, 1, ".eln");
  if (!archive) co_return http::problem(archive.error());
  auto samples = co_await begin_export_file(parts.exports, wanted->spans, 1, ".sqlite");
  if (!samples) co_return http::problem(samples.error());
  const EndOnWorker on_worker{parts.exports.tasks, parts.exports.history.reader()};
  const std::unique_ptr<analysis::RunCapsule, EndOnWorker> writer{
      new analysis::RunCapsule{(*archive)->path(), (*samples)->path(), std::move(*wanted)}, on_worker};
  const Result<void> written = co_await write_in_slices(parts.exports, *writer);
  if (!written) co_return http::problem(written.error());
  http::Response response;
  response.content_type = "application/vnd.eln+zip";
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Disposition", fmt::format("attachment; filename=\"run-{}.eln\"", *id));
  response.stream = std::make_unique<FileStream>(parts.exports.history, std::move(*archive));
  co_return response;
}

}  // namespace

void add_capsule_routes(http::Router& router, CapsuleRoutes parts) {
  router.add({"GET", "/api/v1/runs/{run_id}/capsule.eln", identity::Scope::record, {}, with(parts, get_capsule)});
}

}  // namespace server::api
