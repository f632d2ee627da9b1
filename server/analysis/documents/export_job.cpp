// Each format is a writer that advances by slices.
#include "server/analysis/documents/export_job.hpp"

#include <fmt/format.h>

#include <fstream>
#include <memory>
#include <stdexcept>

#include "server/storage/export/csv_writer.hpp"
#include "server/storage/export/mat_writer.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/upkeep/export_space.hpp"

namespace server::analysis {
namespace asio = boost::asio;

namespace {

constexpr std::uint64_t kUsualPeriod_us = 10'000;

// CSV as a file.
class CsvFile {
 public:
  CsvFile(const std::filesystem::path& path, std::vector<storage::RecordedSpan> spans,
          const storage::ExportQuery& query)
      : file_{path, std::ios::binary}, writer_{std::move(spans), query} {}

  Result<bool> advance(SQLite::Database& database) {
    const auto text = writer_.next(database);
    if (text) file_ << *text;
    if (!text) file_.close();
    if (!file_) throw std::runtime_error{"the export cannot be written"};
    return text.has_value();
  }

 private:
  std::ofstream file_;
  storage::CsvWriter writer_;
};

// To its end, until there is no room, or until it is cancelled. The writer lives on the thread that it writes on.
template <class Writer>
asio::awaitable<Result<void>> write_all(ExportParts parts, std::shared_ptr<Writer> writer, std::filesystem::path path,
                                        storage::JobRun& run) {
  for (Result<bool> more = true; *more;) {
    if (run.is_cancelled()) co_return fail(ErrorCode::conflict, "cancelled");
    auto slice = [writer, folder = parts.files.folder()](SQLite::Database& database) -> Result<bool> {
      if (const auto room = storage::room_for_more(folder); !room) return std::unexpected{room.error()};
      return writer->advance(database);
    };
    more = co_await parts.exports.reader().ask(std::move(slice));
    if (!more) co_return std::unexpected{more.error()};
    auto size = [path] { return storage::file_bytes(path); };
    const std::uint64_t bytes = co_await parts.exports.reader().run(std::move(size));
    if (bytes > storage::kMaxJobFileBytes) {
      co_return fail(
          ErrorCode::invalid,
          fmt::format("the file would have more than {} bytes; ask for the export itself", storage::kMaxJobFileBytes),
          "too_large");
    }
    run.report(0, fmt::format("writing: {:.1f} MB", 1e-6 * static_cast<double>(bytes)));
  }
  auto end = [writer = std::move(writer)]() mutable { writer.reset(); };
  co_await parts.exports.reader().run(std::move(end));
  co_return Result<void>{};
}

template <class Writer, class... Arguments>
asio::awaitable<Result<void>> write_with(ExportParts parts, storage::JobRun& run, std::filesystem::path path,
                                         Arguments... arguments) {
  auto make = [path, ... arguments = std::move(arguments)] { return std::make_shared<Writer>(path, arguments...); };
  auto writer = co_await parts.exports.reader().run(std::move(make));
  co_return co_await write_all(parts, std::move(writer), path, run);
}

}  // namespace

const char* text(ExportFormat value) {
  switch (value) {
    case ExportFormat::csv: return "csv";
    case ExportFormat::mat: return "mat";
    case ExportFormat::sqlite: return "sqlite";
  }
  return "";
}

asio::awaitable<Result<void>> write_export(ExportParts parts, ExportRequest request, storage::JobRun& run) {
  if (auto may = parts.disk_watch.may_begin("an export to a file"); !may) co_return may;
  run.report(0, fmt::format("reading run {}", request.query.run));
  auto spans = co_await parts.exports.spans(storage::excerpt_of(request.query.run));
  if (!spans) co_return std::unexpected{spans.error()};
  for (storage::RecordedSpan& span : *spans) span.cut(span.made());
  const std::filesystem::path path = co_await parts.files.begin_draft(run.id());
  auto look = [folder = parts.files.folder(), spans = *spans, query = request.query](SQLite::Database& database) {
    const auto grid_us = static_cast<std::uint64_t>(query.grid_us.value_or(kUsualPeriod_us));
    return storage::room_for_export(folder, most_samples(database, spans) * (1 + kUsualPeriod_us / grid_us));
  };
  const auto room = co_await parts.exports.reader().ask(std::move(look));
  if (!room) co_return room;
  co_await parts.exports.settle();  // events and commands that were received
  const storage::ExportQuery query = request.query;
  switch (request.format) {
    case ExportFormat::csv: co_return co_await write_with<CsvFile>(parts, run, path, *spans, query);
    case ExportFormat::mat: co_return co_await write_with<storage::MatWriter>(parts, run, path, *spans, query);
    case ExportFormat::sqlite: break;
  }
  const std::string store = storage::reading_uri(parts.database, false);
  co_return co_await write_with<storage::RunFile>(parts, run, path, store, *spans, query);
}

}  // namespace server::analysis
