// One query over the view run_sample.
#include "server/storage/query/run_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <charconv>

#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/samples/stored_rows.hpp"

namespace server::storage {
namespace {

// The view gives the samples of a run in order of span and seq, without sorting. That of schema version 1, which a
// station has not opened since, knows no time of the first receipt: the same as the last one's then.
std::string select_samples(std::int64_t version) {
  std::string sql =
      fmt::format("SELECT span, boot_id, seq, robot_time_us, utc_us, clock_uncertainty_us, {}, received_at_us",
                  version == 1 ? "received_at_us" : "first_received_at_us");
  const auto add = [&](const auto& field) { (sql += ", ") += column_or_null(field, version); };
  station::for_each_sample_field(add);
  station::for_each_batch_field(add);
  return sql;
}

std::string run_query(std::int64_t version) {
  return select_samples(version) + " FROM run_sample WHERE run_id = ? LIMIT ?";
}

std::uint64_t id_from(const std::string& text) {  // decimal text: it may exceed int64
  std::uint64_t id = 0;
  std::from_chars(text.data(), text.data() + text.size(), id);
  return id;
}

void read_field(const SQLite::Column& column, std::optional<float>& into) { into = optional_float(column); }
void read_field(const SQLite::Column& column, std::uint32_t& into) { into = column.getUInt(); }
void read_field(const SQLite::Column& column, std::uint64_t& into) { into = id_from(column.getString()); }
template <class Enumerator>
void read_field(const SQLite::Column& column, Enumerator& into) {
  into = enumerator_from<Enumerator>(column.getString());
}

StoredSample sample_from(SQLite::Statement& row) {
  StoredSample stored;
  stored.span = row.getColumn(0).getUInt();
  stored.boot_id = id_from(row.getColumn(1).getString());
  stored.seq = unsigned_id(row.getColumn(2));
  stored.robot_time_us = unsigned_id(row.getColumn(3));
  stored.utc_us = row.getColumn(4).getInt64();
  stored.clock_uncertainty_us = row.getColumn(5).getInt64();
  stored.first_received_at_us = row.getColumn(6).getInt64();
  stored.received_at_us = row.getColumn(7).getInt64();
  int column = 8;
  station::for_each_sample_field(
      [&](const station::SampleField& field) { stored.sample.*field.member = float_or_nan(row.getColumn(column++)); });
  station::for_each_batch_field([&](const auto& field) { read_field(row.getColumn(column++), stored.*field.member); });
  return stored;
}

Result<void> check_ours(SQLite::Database& database, const std::filesystem::path& path) {
  const auto application_id = database.execAndGet("PRAGMA application_id").getInt64();
  const auto version = database.execAndGet("PRAGMA user_version").getInt64();
  if (application_id != kApplicationId) {
    return fail(ErrorCode::invalid,
                fmt::format("{} is not a database of Rheonaut (application_id {:#x})", path.string(), application_id));
  }
  if (version < 1 || version > static_cast<std::int64_t>(migrations().size())) {
    return fail(ErrorCode::invalid, fmt::format("{} has schema version {}, this program knows 1 to {}", path.string(),
                                                version, migrations().size()));
  }
  return {};
}

Result<std::vector<StoredSample>> query_run(SQLite::Database& database, RunId run, std::size_t limit) {
  SQLite::Statement exists{database, "SELECT 1 FROM run WHERE run_id = ?"};
  bind_all(exists, run);
  if (!exists.executeStep()) {
    SQLite::Statement range{database, "SELECT count(*), min(run_id), max(run_id) FROM run"};
    range.executeStep();
    return fail(ErrorCode::not_found, range.getColumn(0).getInt64() == 0
                                          ? fmt::format("there is no run {}: the database holds no runs", run)
                                          : fmt::format("there is no run {}: the database holds runs {} to {}", run,
                                                        range.getColumn(1).getInt64(), range.getColumn(2).getInt64()));
  }
  std::vector<StoredSample> samples;
  SQLite::Statement rows{database, run_query(database.execAndGet("PRAGMA user_version").getInt64())};
  bind_all(rows, run, static_cast<std::int64_t>(limit + 1));
  while (rows.executeStep()) samples.push_back(sample_from(rows));
  if (samples.size() > limit) {
    return fail(ErrorCode::invalid, fmt::format("run {} has more than {} samples", run, limit), "run_too_long");
  }
  return samples;
}

}  // namespace

bool lock_is_free(const std::filesystem::path& database) {
  const auto lock_path = database.parent_path() / "rheonaut.lock";
  const int lock = ::open(lock_path.c_str(), O_RDONLY | O_CLOEXEC);
  if (lock < 0) return errno == ENOENT;
  const bool is_free = ::flock(lock, LOCK_SH | LOCK_NB) == 0;
  ::close(lock);
  return is_free;
}

namespace {

bool is_at_rest(const std::filesystem::path& path) {
  return !std::filesystem::exists(path.string() + "-wal") && lock_is_free(path);
}

// Whose the file is, or its write-ahead log, that this program may not read.
std::optional<std::string> denied_store(const std::filesystem::path& path) {
  for (const char* suffix : {"", "-wal", "-shm"}) {
    if (auto denial = runtime::denied(std::filesystem::path{path}.concat(suffix), R_OK)) return denial;
  }
  return std::nullopt;
}

// As a URI, which alone can say that the file does not change: then SQLite makes no files beside it.
SQLite::Database open_at_rest(const std::filesystem::path& path) {
  return SQLite::Database{reading_uri(path, true), SQLite::OPEN_READONLY | SQLite::OPEN_URI};
}

}  // namespace

std::string reading_uri(const std::filesystem::path& path, bool at_rest) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(path).string()) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || std::string_view{"/._-"}.contains(c);
    uri += is_plain ? std::string{c} : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return uri + (at_rest ? "?immutable=1" : "?mode=ro");
}

Result<void> read_store(const std::filesystem::path& path, const ReadStore& read) {
  if (const auto denial = denied_store(path)) {
    return fail(ErrorCode::unavailable, fmt::format("cannot read {}: {}", path.string(), *denial));
  }
  if (!std::filesystem::exists(path)) {
    return fail(ErrorCode::not_found, fmt::format("there is no {}; --data names the station's folder", path.string()));
  }
  const auto checked = [&](SQLite::Database database, bool at_rest) {
    auto ours = check_ours(database, path);
    return ours ? read(database, reading_uri(path, at_rest)) : ours;
  };
  try {
    if (is_at_rest(path)) {
      const auto written = std::filesystem::last_write_time(path);
      auto done = checked(open_at_rest(path), true);
      if (is_at_rest(path) && std::filesystem::last_write_time(path) == written) return done;
    }
    return checked(open_for_reading(path), false);  // also when a station has begun meanwhile
  } catch (const SQLite::Exception& error) {
    // A database that was left with its log is read by a file beside it.
    const auto denial = error.getErrorCode() == SQLITE_CANTOPEN
                            ? runtime::denied(std::filesystem::absolute(path).parent_path(), W_OK | X_OK)
                            : std::nullopt;
    return fail(ErrorCode::unavailable,
                fmt::format("cannot read {}: {}", path.string(), denial.value_or(runtime::text_of(error))));
  }
}

Result<std::vector<StoredSample>> read_exported_run(SQLite::Database& file, std::size_t limit) {
  const auto newest = static_cast<std::int64_t>(migrations().size());
  std::vector<StoredSample> samples;
  SQLite::Statement rows{file, select_samples(newest) + " FROM sample ORDER BY span, seq LIMIT ?"};
  bind_all(rows, static_cast<std::int64_t>(limit + 1));
  while (rows.executeStep()) samples.push_back(sample_from(rows));
  if (samples.size() <= limit) return samples;
  return fail(ErrorCode::invalid, fmt::format("the run has more than {} samples", limit), "run_too_long");
}

Result<std::vector<StoredSample>> read_run(const std::filesystem::path& path, RunId run, std::size_t limit) {
  std::vector<StoredSample> samples;
  auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    auto found = query_run(database, run, limit);
    if (!found) return std::unexpected{found.error()};
    samples = std::move(*found);
    return {};
  };
  auto done = read_store(path, read);
  if (!done) return std::unexpected{done.error()};
  return samples;
}

}  // namespace server::storage
