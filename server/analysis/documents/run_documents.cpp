// Questions to the store one after another, and one computation for each run.
#include "server/analysis/documents/run_documents.hpp"

#include <fmt/format.h>

#include "base/json_text.hpp"
#include "base/version.hpp"
#include "server/analysis/comparison/aligned_runs_json.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/analysis/report/comparison_report.hpp"
#include "server/analysis/report/run_report.hpp"
#include "server/storage/query/run_events.hpp"

namespace server::analysis {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

constexpr std::size_t kAuditEntriesLookedAt = 1000;
constexpr std::size_t kMostDesigns = 100;         // in a report
constexpr std::size_t kReportValues = 4'000'000;  // in memory alone: plots draw four points for a column of pixels

bool goes_on(const Watch& watch, std::size_t done, std::size_t runs, storage::RunId run) {
  if (!watch) return true;
  return watch(static_cast<double>(done) / static_cast<double>(runs), fmt::format("run {}", run));
}

std::unexpected<Error> was_ended() { return fail(ErrorCode::conflict, "cancelled"); }

MetricsOfRun with_missed_ticks(storage::Run run, storage::StoredMetrics metrics, bool is_kept) {
  json document = json::parse(metrics.document, nullptr, false);
  if (document.is_object()) add_missed_ticks(document, run);
  metrics.document = base::dump(document);
  return {std::move(run), std::move(metrics), is_kept};
}

// Kinds of events, or none for the run's markers.
std::vector<std::string> kinds_of(const Alignment& alignment) {
  if (alignment.at == AlignAt::event) return {alignment.name};
  return {};
}

// Parses the design: on a worker.
DesignOfRun line_of(const storage::Design& design) {
  return {design.id, storage::text(design.made.kind), design.made.name,
          doubts_about_model(json::parse(design.made.document, nullptr, false))};
}

ControllerInReport line_of(const storage::ControllerOfRun& one) {
  ControllerInReport line{one.controller.id, one.controller.made.name, one.controller.sha256, {}, {}};
  if (!one.model) return line;
  line.model = line_of(*one.model);
  for (const storage::DesignSource& source : one.model->made.sources) line.model_runs.push_back(source.run);
  return line;
}

}  // namespace

asio::awaitable<Result<std::int64_t>> RunDocuments::reference_time(storage::RunId run) {
  const auto reference = co_await parts_.analysis.reference(run);
  if (!reference) co_return std::unexpected{reference.error()};
  co_return *reference ? (*reference)->made_at_us : 0;
}

asio::awaitable<Result<MetricsOfRun>> RunDocuments::metrics(storage::RunId id) {
  auto run = co_await parts_.runs.find(id);
  if (!run) co_return std::unexpected{run.error()};
  const auto reference_us = co_await reference_time(id);
  if (!reference_us) co_return std::unexpected{reference_us.error()};
  const bool is_kept = run->state != storage::RunState::open;
  const auto samples = static_cast<std::int64_t>(run->samples_stored);
  if (is_kept) {
    auto found = co_await parts_.metrics.find(id, kMetricsVersion, samples, *reference_us);
    if (found) co_return with_missed_ticks(std::move(*run), std::move(*found), true);
  }
  const auto computed = co_await parts_.analysis.metrics(*run);
  if (!computed) co_return std::unexpected{computed.error()};
  const auto& reference = computed->measures.reference;
  storage::StoredMetrics made{id,
                              kMetricsVersion,
                              base::version(),
                              samples,
                              reference ? reference->made_at_us : 0,
                              parts_.clock.utc_us(),
                              base::dump(json_of(*computed))};
  if (is_kept) {
    const auto stored = co_await parts_.metrics.store(made);
    if (!stored) co_return std::unexpected{stored.error()};
  }
  co_return with_missed_ticks(std::move(*run), std::move(made), is_kept);
}

asio::awaitable<Result<json>> RunDocuments::comparison(RunIds ids) {
  std::vector<storage::Run> runs;
  std::vector<json> documents;
  for (const storage::RunId id : ids) {
    auto found = co_await metrics(id);
    if (!found) co_return std::unexpected{found.error()};
    runs.push_back(std::move(found->run));
    documents.push_back(json::parse(found->metrics.document, nullptr, false));
  }
  co_return comparison_json(runs, documents);
}

// The newest entries of the audit that are of the run.
asio::awaitable<std::vector<storage::AuditEntry>> RunDocuments::audit_of(const storage::Run& run) {
  storage::AuditFilter filter;
  filter.robot_id = run.robot_id;
  filter.action = "run";
  filter.limit = kAuditEntriesLookedAt;
  const std::string subject = fmt::format("{}", run.id);
  auto page = co_await parts_.history.audit(std::move(filter));
  std::erase_if(page.entries, [&](const storage::AuditEntry& entry) { return entry.note.subject != subject; });
  co_return std::move(page.entries);
}

asio::awaitable<std::vector<storage::Design>> RunDocuments::designs_of(storage::RunId run) {
  storage::DesignFilter filter;
  filter.run = run;
  filter.limit = kMostDesigns;
  co_return co_await parts_.designs.list(filter);
}

asio::awaitable<std::string> RunDocuments::sha256_of(storage::RunId run) {
  const auto digest = co_await parts_.digester.find(run);
  co_return digest && digest->is_final ? digest->digest.sha256 : std::string{};
}

asio::awaitable<Result<std::string>> RunDocuments::report(storage::RunId id, std::optional<std::int64_t> made_at_us) {
  auto found = co_await metrics(id);
  if (!found) co_return std::unexpected{found.error()};
  auto trace = co_await parts_.analysis.trace(id);
  if (!trace) co_return std::unexpected{trace.error()};
  RunReport report;
  report.run = std::move(found->run);
  report.trace = std::move(trace->points);
  report.reference = std::move(trace->reference);
  report.metrics = json::parse(found->metrics.document, nullptr, false);
  add_position_doubts(report.metrics);
  const auto designs = co_await designs_of(id);
  const auto made_with = co_await parts_.designs.controllers_of(id);
  report.sha256 = co_await sha256_of(id);
  report.audit = co_await audit_of(report.run);
  report.program = base::version();
  report.made_at_us = made_at_us.value_or(parts_.clock.utc_us());
  auto write = [report = std::move(report), designs, made_with]() mutable {
    for (const storage::Design& design : designs) report.designs.push_back(line_of(design));
    for (const storage::ControllerOfRun& one : made_with) report.made_with.push_back(line_of(one));
    return html_of(report);
  };
  co_return co_await parts_.analysis.compute(std::move(write));
}

asio::awaitable<Result<AlignedRun>> RunDocuments::aligned_run(storage::RunId id, const TracesRequest& request) {
  const auto run = co_await parts_.runs.find(id);
  if (!run) co_return std::unexpected{run.error()};
  auto trace = co_await parts_.analysis.trace(id, kMaxSamplesOfComparedRun);
  if (!trace) co_return std::unexpected{trace.error()};
  auto find = [id, kinds = kinds_of(request.alignment)](SQLite::Database& database) {
    return kinds.empty() ? storage::read_run_markers(database, id) : storage::read_run_events(database, id, kinds);
  };
  co_await parts_.history.settle();  // events that were received
  auto moments = co_await parts_.history.reader().ask(std::move(find));
  auto align = [id, name = run->conditions.name, request, trace = std::move(*trace),
                moments = std::move(moments)]() -> Result<AlignedRun> {
    const std::string label = fmt::format("run {} ('{}')", id, name);
    const std::vector<double> times_s = times_of(trace.points);
    const auto aligned = find_alignment(label, trace.points, times_s, request.alignment, moments);
    if (!aligned) return std::unexpected{aligned.error()};
    auto on_grid = trace_on_grid(label, trace.points, times_s, aligned->at_s, request.channels, request.grid(),
                                 trace.reference ? &*trace.reference : nullptr);
    if (!on_grid) return std::unexpected{on_grid.error()};
    return AlignedRun{id, name, *aligned, std::move(*on_grid)};
  };
  co_return co_await parts_.analysis.compute(std::move(align));
}

asio::awaitable<Result<AlignedRuns>> RunDocuments::traces(RunIds ids, TracesRequest request, Watch watch) {
  std::vector<AlignedRun> runs;
  for (const storage::RunId id : ids) {
    if (!goes_on(watch, runs.size(), ids.size(), id)) co_return was_ended();
    auto run = co_await aligned_run(id, request);
    if (!run) co_return std::unexpected{run.error()};
    runs.push_back(std::move(*run));
  }
  auto put = [request = std::move(request), runs = std::move(runs)]() mutable {
    return put_together(std::move(request), std::move(runs));
  };
  co_return co_await parts_.analysis.compute(std::move(put));
}

asio::awaitable<Result<std::string>> RunDocuments::traces_json(RunIds ids, TracesRequest request, Watch watch) {
  auto aligned = co_await traces(std::move(ids), std::move(request), std::move(watch));
  if (!aligned) co_return std::unexpected{aligned.error()};
  auto write = [aligned = std::move(*aligned)] { return json_of(aligned).dump(); };
  co_return co_await parts_.analysis.compute(std::move(write));
}

asio::awaitable<Result<ImpedanceMaps>> RunDocuments::impedance_maps(RunIds ids, double bin_m, Watch watch) {
  ImpedanceMaps maps;
  for (const storage::RunId id : ids) {
    if (!goes_on(watch, maps.runs.size(), ids.size(), id)) co_return was_ended();
    auto trace = co_await parts_.analysis.trace(id, kMaxSamplesOfComparedRun);
    if (!trace) co_return std::unexpected{trace.error()};
    auto find = [id](SQLite::Database& database) {
      return storage::read_run_events(database, id, kinds_on_impedance_map());
    };
    co_await parts_.history.settle();
    auto events = co_await parts_.history.reader().ask(std::move(find));
    auto place = [id, bin_m, trace = std::move(*trace), events = std::move(events)] {
      return impedance_map(id, trace.points, events, bin_m, trace.reference ? &*trace.reference : nullptr);
    };
    auto map = co_await parts_.analysis.compute(std::move(place));
    if (!map) co_return std::unexpected{map.error()};
    maps.runs.push_back(std::move(*map));
  }
  maps.together = together(maps.runs);
  co_return maps;
}

asio::awaitable<Result<std::string>> RunDocuments::comparison_report(RunIds ids, TracesRequest request, Watch watch) {
  ComparisonReport report;
  request.channels = report_channels();
  request.most_values = kReportValues;
  auto compared = co_await comparison(ids);
  if (!compared) co_return std::unexpected{compared.error()};
  report.comparison = std::move(*compared);
  const Watch first_half = [watch](double share, const std::string& stage) {
    return !watch || watch(0.5 * share, "traces of " + stage);
  };
  auto aligned = co_await traces(ids, std::move(request), first_half);
  if (!aligned) co_return std::unexpected{aligned.error()};
  report.aligned = std::move(*aligned);
  const Watch second_half = [watch](double share, const std::string& stage) {
    return !watch || watch(0.5 + 0.5 * share, "impedance of " + stage);
  };
  auto maps = co_await impedance_maps(ids, 1e-3 * static_cast<double>(kUsualBinMm), second_half);
  if (!maps) co_return std::unexpected{maps.error()};
  if (maps->together.has_detections()) report.map = std::move(maps->together);
  for (const storage::RunId id : ids) {
    auto run = co_await parts_.runs.find(id);
    if (!run) co_return std::unexpected{run.error()};
    report.runs.push_back(std::move(*run));
    report.sha256.push_back(co_await sha256_of(id));
  }
  report.program = base::version();
  report.made_at_us = parts_.clock.utc_us();
  auto write = [report = std::move(report)] { return html_of(report); };
  co_return co_await parts_.analysis.compute(std::move(write));
}

}  // namespace server::analysis
