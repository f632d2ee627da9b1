// Asks each part of the recording for its share.
#include "server/api/analysis/run_documents.hpp"

#include <fmt/format.h>

#include "base/json_text.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/runs.hpp"

namespace server::api {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

constexpr std::size_t kAuditEntriesLookedAt = 1000;

// What the run is measured by now; 0: by its own record.
asio::awaitable<Result<std::int64_t>> reference_time(RunMetricsRoutes parts, storage::RunId id) {
  const auto reference = co_await parts.analysis.reference(id);
  if (!reference) co_return std::unexpected{reference.error()};
  co_return *reference ? (*reference)->made_at_us : 0;
}

// The newest entries of the audit that are of the run.
asio::awaitable<std::vector<storage::AuditEntry>> audit_of(RunMetricsRoutes parts, const storage::Run& run) {
  storage::AuditFilter filter;
  filter.robot_id = run.robot_id;
  filter.action = "run";
  filter.limit = kAuditEntriesLookedAt;
  const std::string subject = fmt::format("{}", run.id);
  auto page = co_await parts.history.audit(std::move(filter));
  std::erase_if(page.entries, [&](const storage::AuditEntry& entry) { return entry.note.subject != subject; });
  co_return std::move(page.entries);
}

}  // namespace

asio::awaitable<Result<MetricsOfRun>> metrics_of(RunMetricsRoutes parts, storage::RunId id) {
  auto run = co_await parts.runs.find(id);
  if (!run) co_return std::unexpected{run.error()};
  const auto reference_us = co_await reference_time(parts, id);
  if (!reference_us) co_return std::unexpected{reference_us.error()};
  const bool is_kept = run->state != storage::RunState::open;
  const auto samples = static_cast<std::int64_t>(run->samples_stored);
  if (is_kept) {
    auto found = co_await parts.metrics.find(id, analysis::kMetricsVersion, samples, *reference_us);
    if (found) co_return MetricsOfRun{std::move(*run), std::move(*found), true};
  }
  const auto computed = co_await parts.analysis.metrics(*run);
  if (!computed) co_return std::unexpected{computed.error()};
  const auto& reference = computed->measures.reference;
  storage::StoredMetrics made{id,
                              analysis::kMetricsVersion,
                              RHEONAUT_VERSION,
                              samples,
                              reference ? reference->made_at_us : 0,
                              parts.clock.utc_us(),
                              base::dump(analysis::json_of(*computed))};
  if (is_kept) {
    const auto stored = co_await parts.metrics.store(made);
    if (!stored) co_return std::unexpected{stored.error()};
  }
  co_return MetricsOfRun{std::move(*run), std::move(made), is_kept};
}

asio::awaitable<Result<analysis::RunReport>> report_of(RunMetricsRoutes parts, storage::RunId id,
                                                       std::int64_t made_at_us) {
  auto found = co_await metrics_of(parts, id);
  if (!found) co_return std::unexpected{found.error()};
  auto trace = co_await parts.analysis.trace(id);
  if (!trace) co_return std::unexpected{trace.error()};
  analysis::RunReport report;
  report.run = std::move(found->run);
  report.trace = std::move(trace->points);
  report.reference = std::move(trace->reference);
  report.metrics = json::parse(found->metrics.document, nullptr, false);
  const auto digest = co_await parts.digester.find(id);
  if (digest && digest->is_final) report.sha256 = digest->digest.sha256;
  report.audit = co_await audit_of(parts, report.run);
  report.program = RHEONAUT_VERSION;
  report.made_at_us = made_at_us;
  co_return report;
}

}  // namespace server::api
