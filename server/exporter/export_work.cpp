// Each format is a writer that advances in slices; what it has passed is where its next page begins.
#include "server/exporter/export_work.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "server/runtime/exceptions.hpp"
#include "server/storage/export/csv_writer.hpp"
#include "server/storage/export/mat/mat_writer.hpp"
#include "server/storage/export/mcap/mcap_writer.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::exporter {
namespace {

using namespace std::chrono_literals;

constexpr auto kBetweenReports = 100ms;

// CSV as a file.
class CsvFile {
 public:
  CsvFile(std::filesystem::path path, std::vector<storage::RecordedSpan> spans, const storage::ExportQuery& query)
      : path_{std::move(path)}, file_{path_, std::ios::binary | std::ios::trunc}, writer_{std::move(spans), query} {}

  Result<bool> advance(SQLite::Database& database) {
    const auto piece = writer_.next(database);
    if (piece) file_ << *piece;
    if (!piece) file_.close();
    if (!file_) throw std::runtime_error{fmt::format("cannot write {}; is the disk full?", path_.string())};
    return piece.has_value();
  }
  const std::optional<storage::SampleCursor>& position() const { return writer_.position(); }

 private:
  std::filesystem::path path_;
  std::ofstream file_;
  storage::CsvWriter writer_;
};

class Reports {
 public:
  Reports(const std::vector<storage::RecordedSpan>& spans,
          const std::function<void(const storage::ExportProgress&)>& report)
      : report_{report} {
    for (const storage::RecordedSpan& span : spans) {
      ranges_.push_back({span.span, span.samples});
      progress_.total += span.samples.next - span.samples.first;
    }
  }

  void on_slice(const std::optional<storage::SampleCursor>& position) {
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ < kBetweenReports) return;
    last_ = now;
    if (position) progress_.passed = passed(*position);
    report_(progress_);
  }

 private:
  struct Range {
    std::uint32_t span;
    storage::Interval samples;
  };

  std::uint64_t passed(const storage::SampleCursor& position) const {
    std::uint64_t passed = 0;
    for (const Range& range : ranges_) {
      if (range.span < position.span) passed += range.samples.next - range.samples.first;
      if (range.span != position.span) continue;
      passed += std::clamp(position.seq + 1, range.samples.first, range.samples.next) - range.samples.first;
    }
    return passed;
  }

  const std::function<void(const storage::ExportProgress&)>& report_;
  std::vector<Range> ranges_;
  storage::ExportProgress progress_;
  std::chrono::steady_clock::time_point last_{};
};

template <class Writer>
Result<void> write_all(SQLite::Database& database, Writer&& writer, Reports& reports) {
  for (;;) {
    const Result<bool> more = writer.advance(database);
    if (!more) return std::unexpected{more.error()};
    if (!*more) return {};
    reports.on_slice(writer.position());
  }
}

// The station's database is only read: what cannot be written is the export.
bool is_of_writing(const SQLite::Exception& error) {
  return error.getErrorCode() == SQLITE_FULL || error.getExtendedErrorCode() == SQLITE_IOERR_WRITE;
}

Result<void> write_in(SQLite::Database& database, const std::string& uri, const storage::ExportOrder& order,
                      std::vector<storage::RecordedSpan> spans, Reports reports) {
  const storage::ExportQuery& query = order.query;
  switch (order.format) {
    case storage::ExportFormat::csv: return write_all(database, CsvFile{order.file, std::move(spans), query}, reports);
    case storage::ExportFormat::mat:
      return write_all(database, storage::MatWriter{order.file, std::move(spans), query}, reports);
    case storage::ExportFormat::sqlite:
      return write_all(database, storage::RunFile{order.file, uri, std::move(spans), query}, reports);
    case storage::ExportFormat::mcap:
      return write_all(database, storage::McapWriter{order.file, uri, std::move(spans), query}, reports);
  }
  return {};
}

}  // namespace

Result<void> write_export(const storage::ExportOrder& order,
                          const std::function<void(const storage::ExportProgress&)>& report) {
  const auto write = [&](SQLite::Database& database, const std::string& uri) -> Result<void> {
    if (database.execAndGet("PRAGMA user_version").getInt64() < 2) {
      return fail(ErrorCode::invalid, "the database is of an earlier version; let a station open it once");
    }
    if (!storage::run_exists(database, order.query.run)) {
      return fail(ErrorCode::not_found,
                  fmt::format("there is no run {} in {}", order.query.run, order.database.parent_path().string()));
    }
    std::vector<storage::RecordedSpan> spans = storage::read_spans(database, order.query.run, 0);
    for (storage::RecordedSpan& span : spans) span.cut(span.made());
    std::filesystem::remove(order.file);  // of an attempt that was begun again
    Reports reports{spans, report};
    try {
      return write_in(database, uri, order, std::move(spans), std::move(reports));
    } catch (const SQLite::Exception& error) {
      if (!is_of_writing(error)) throw;
      return fail(ErrorCode::unavailable,
                  fmt::format("cannot write {}: {}", order.file.string(), runtime::text_of(error)), "low_space");
    }
  };
  return storage::read_store(order.database, write);
}

}  // namespace server::exporter
