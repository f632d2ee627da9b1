// Writes beside the wanted file, and gives it its name when it is whole and on disk.
#include "server/cli/data/export.hpp"

#include <fmt/format.h>

#include <fstream>
#include <ostream>
#include <stdexcept>

#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/storage/database/finished_file.hpp"
#include "server/storage/export/csv_writer.hpp"
#include "server/storage/export/mat_writer.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::cli {
namespace {

constexpr std::int64_t kLargestRun = std::numeric_limits<std::int64_t>::max();
constexpr long long kMinGridUs = 100;
constexpr long long kMaxGridUs = 3'600'000'000;

// Removed unless keep() was called.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& wanted) : wanted_{wanted}, path_{wanted.string() + ".part"} {
    clear();
  }
  ~PartFile() { clear(); }
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  void keep() { storage::finish_file(path_, wanted_); }

 private:
  void clear() const {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }

  std::filesystem::path wanted_;
  std::filesystem::path path_;
};

Result<void> write_csv(SQLite::Database& database, storage::CsvWriter writer, const std::filesystem::path& path) {
  std::ofstream file{path, std::ios::binary | std::ios::trunc};
  while (const auto piece = writer.next(database)) file << *piece;
  file.flush();
  if (!file) throw std::runtime_error{fmt::format("cannot write {}; is the disk full?", path.string())};
  return {};
}

Result<void> write_mat(SQLite::Database& database, const std::filesystem::path& path,
                       std::vector<storage::RecordedSpan> spans, const storage::ExportQuery& query) {
  storage::MatWriter writer{path, std::move(spans), query};
  for (;;) {
    const auto more = writer.advance(database);
    if (!more) return std::unexpected{more.error()};
    if (!*more) return {};
  }
}

Result<void> write_sqlite(SQLite::Database& database, const std::string& uri, const std::filesystem::path& path,
                          std::vector<storage::RecordedSpan> spans, const storage::ExportQuery& query) {
  std::filesystem::remove(path);  // of an attempt that was begun again
  storage::RunFile writer{path, uri, std::move(spans), query};
  while (writer.advance(database)) continue;
  return {};
}

Result<void> write(SQLite::Database& database, const std::string& uri, const Export& options,
                   const storage::ExportQuery& query, const std::filesystem::path& path) {
  if (database.execAndGet("PRAGMA user_version").getInt64() < 2) {
    return fail(ErrorCode::invalid, "the database is of an earlier version; let a station open it once");
  }
  if (!storage::run_exists(database, query.run)) {
    return fail(ErrorCode::not_found, fmt::format("there is no run {} in {}", query.run, options.data_dir.string()));
  }
  std::vector<storage::RecordedSpan> spans = storage::read_spans(database, query.run, 0);
  for (storage::RecordedSpan& span : spans) span.cut(span.made());
  switch (options.format) {
    case ExportFormat::csv: return write_csv(database, storage::CsvWriter{std::move(spans), query}, path);
    case ExportFormat::mat: return write_mat(database, path, std::move(spans), query);
    case ExportFormat::sqlite: return write_sqlite(database, uri, path, std::move(spans), query);
  }
  return {};
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

void add_options(CLI::App& command, Export& options) {
  command.add_option("--run", options.run, "A recorded run by its number")->required()->check(whole(1, kLargestRun));
  add_word(command, "--format", options.format, std::array{ExportFormat::csv, ExportFormat::mat, ExportFormat::sqlite},
           "csv, mat (MATLAB and Octave) or sqlite")
      ->required();
  command.add_option("--to", options.to, "The file; one that is there is replaced")->required()->check(named());
  command.add_option("--grid-us", options.grid_us, "csv, mat: rows at equal steps of time, the nearest sample or none")
      ->check(whole(kMinGridUs, kMaxGridUs));
  command
      .add_option("--channels", options.channels, "Names with commas between them, e.g. position_m,duty; default all")
      ->check(named());
  command.add_option("--data", options.data_dir, "Folder of the station that recorded it (default: rheonaut-data)")
      ->check(named());
  command.footer("Example: rheonaut export --run 1 --format mat --to run-1.mat --data ~/lab");
}

int run(const Export& options, std::ostream& out) {
  storage::ExportQuery query{.run = options.run, .channels = storage::all_channels(), .grid_us = options.grid_us};
  if (options.grid_us && options.format == ExportFormat::sqlite) throw UsageError{"--grid-us is for csv and mat"};
  if (!options.channels.empty()) {
    const auto channels = storage::parse_channels(options.channels);
    if (!channels) throw UsageError{"--" + channels.error().detail};
    query.channels = *channels;
  }
  PartFile part{options.to};
  const auto read = [&](SQLite::Database& database, const std::string& uri) {
    return write(database, uri, options, query, part.path());
  };
  const auto done = storage::read_store(options.data_dir / "station.sqlite", read);
  if (!done) throw std::runtime_error{done.error().detail};
  part.keep();
  out << fmt::format("run {}: {} ({} bytes)\n", options.run, options.to.string(),
                     std::filesystem::file_size(options.to));
  return 0;
}

}  // namespace server::cli
