// A run to take away: as CSV, as a MAT file, as a SQLite file, as an MCAP file.
#include <fmt/format.h>

#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/csv_export.hpp"
#include "server/api/routes/routes.hpp"
#include "server/storage/export/export_slots.hpp"
#include "server/storage/query/history.hpp"

namespace server::api {
namespace asio = boost::asio;

namespace {

constexpr std::int64_t kMinGridUs = 100;
constexpr std::int64_t kMaxGridUs = 3'600'000'000;
constexpr std::uint64_t kUsualPeriodUs = 10'000;

struct ParsedExport {
  storage::ExportQuery query;
  std::vector<storage::RecordedSpan> spans;  // as far as they were made when the export began
};

asio::awaitable<Result<ParsedExport>> parse_export(ExportRoutes parts, http::Request request) {
  ParsedExport parsed;
  const auto run = run_id_of(request);
  if (!run) co_return std::unexpected{run.error()};
  const auto channels = query_channels(request);
  if (!channels) co_return std::unexpected{channels.error()};
  const auto grid_us = query_number(request, "grid_us", kMinGridUs, kMaxGridUs, 0);
  if (!grid_us) co_return std::unexpected{grid_us.error()};
  parsed.query = {.run = *run, .channels = *channels, .grid_us = {}};
  if (*grid_us != 0) parsed.query.grid_us = *grid_us;
  auto spans = co_await parts.history.spans(storage::excerpt_of(*run));
  if (!spans) co_return std::unexpected{spans.error()};
  for (storage::RecordedSpan& span : *spans) span.cut(span.made());
  parsed.spans = std::move(*spans);
  co_return parsed;
}

http::Response attachment(const char* content_type, storage::RunId run, const char* ending,
                          std::unique_ptr<http::BodyStream> stream) {
  http::Response response;
  response.content_type = content_type;
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Disposition", fmt::format("attachment; filename=\"run-{}{}\"", run, ending));
  response.stream = std::move(stream);
  return response;
}

http::Answer export_csv(ExportRoutes parts, http::Request request) {
  auto parsed = co_await parse_export(parts, std::move(request));
  if (!parsed) co_return http::problem(parsed.error());
  const storage::RunId run = parsed->query.run;
  co_return attachment("text/csv; charset=utf-8", run, ".csv",
                       std::make_unique<CsvStream>(parts.history, std::move(parsed->spans), parsed->query));
}

// The most rows that an export may have for each sample.
std::uint64_t most_rows(const ParsedExport& parsed) {
  return 1 + kUsualPeriodUs / static_cast<std::uint64_t>(parsed.query.grid_us.value_or(kMaxGridUs));
}

http::Answer export_file(ExportRoutes parts, http::Request request, storage::ExportFormat format,
                         const char* content_type) {
  auto parsed = co_await parse_export(parts, std::move(request));
  if (!parsed) co_return http::problem(parsed.error());
  if (const auto may = parts.slots.may_begin(); !may) co_return http::problem(may.error());
  const runtime::Counted slot{parts.slots.taken};
  const std::string ending = fmt::format(".{}", text(format));
  auto file = co_await begin_export_file(parts, parsed->spans, most_rows(*parsed), ending);
  if (!file) co_return http::problem(file.error());
  const auto stored = co_await parts.history.store_waiting(std::move(parsed->spans));
  if (!stored) co_return http::problem(stored.error());
  storage::ExportOrder order{parts.database, format, parsed->query, (*file)->path()};
  const std::unique_ptr<storage::ExportChild, EndOnWorker> child{new storage::ExportChild{std::move(order)},
                                                                 EndOnWorker{parts.tasks, parts.history.reader()}};
  const Result<void> written = co_await write_in_slices(parts, *child);
  if (!written) co_return http::problem(written.error());
  co_return attachment(content_type, parsed->query.run, ending.c_str(),
                       std::make_unique<FileStream>(parts.history, std::move(*file)));
}

http::Answer export_mat(ExportRoutes parts, http::Request request) {
  return export_file(parts, std::move(request), storage::ExportFormat::mat, "application/x-matlab-data");
}

http::Answer export_sqlite(ExportRoutes parts, http::Request request) {
  return export_file(parts, std::move(request), storage::ExportFormat::sqlite, "application/vnd.sqlite3");
}

http::Answer export_mcap(ExportRoutes parts, http::Request request) {
  return export_file(parts, std::move(request), storage::ExportFormat::mcap, "application/octet-stream");
}

}  // namespace

void add_export_routes(http::Router& router, ExportRoutes parts) {
  const auto add = [&router, parts](const char* pattern, std::vector<std::string> query,
                                    http::Answer (*answer)(ExportRoutes, http::Request)) {
    router.add({"GET", pattern, identity::Scope::record, std::move(query), with(parts, answer)});
  };
  add("/api/v1/runs/{run_id}/samples.csv", {"channels", "grid_us"}, export_csv);
  add("/api/v1/runs/{run_id}/samples.mat", {"channels", "grid_us"}, export_mat);
  add("/api/v1/runs/{run_id}/samples.sqlite", {}, export_sqlite);
  add("/api/v1/runs/{run_id}/samples.mcap", {}, export_mcap);
}

}  // namespace server::api
