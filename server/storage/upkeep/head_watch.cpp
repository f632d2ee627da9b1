// Look, compare, write.
#include "server/storage/upkeep/head_watch.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sqlite3.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

// Empty when it is written.
std::string try_to_save(const std::filesystem::path& database, const HeadFile& file) {
  try {
    save_head_file(database, file);
    return {};
  } catch (const std::exception& error) {
    return runtime::text_of(error);
  }
}

struct Look {
  std::optional<StoreHead> written;  // empty: it is as it was
  std::string problem;
};

// Reads with a handle of its own, which sees what is durable.
Look write_if_changed(const std::filesystem::path& path, HeadFile file, const std::function<bool()>& names_hold) {
  try {
    if (!names_hold()) return {std::nullopt, "the files of the database have lost their names"};
    SQLite::Database database = open_for_reading(path);
    const StoreHead now = read_store_head(database);
    if (now == file.head) return {};
    file.head = now;
    save_head_file(path, file);
    return {now, ""};
  } catch (const std::exception& error) {
    return {std::nullopt, runtime::text_of(error)};
  }
}

}  // namespace

HeadWatch::HeadWatch(runtime::Clock& clock, Recorder& recorder, runtime::WorkerThread& checkpoints,
                     microseconds interval)
    : clock_{clock}, recorder_{recorder}, checkpoints_{checkpoints}, interval_{interval}, path_{recorder.path()} {}

struct HeadWatch::Opened {
  HeadFile file;
  std::optional<std::string> loss;
  std::string problem;
};

// On the disk thread. What the database cannot answer keeps no station from starting.
HeadWatch::Opened HeadWatch::compare(Database& database, const std::filesystem::path& path, std::int64_t utc_us) {
  Opened opened;
  const auto before = load_head_file(path);
  if (before && *before) opened.file = **before;
  if (!before) opened.loss = before.error().detail;
  try {
    if (before && *before) opened.loss = find_loss(database.handle(), opened.file);
    opened.file.head = read_store_head(database.handle());
    opened.file.at_us = utc_us;
  } catch (const SQLite::Exception& error) {
    opened.problem = runtime::text_of(error);
    if (error.getErrorCode() != SQLITE_CORRUPT) return opened;
    opened.loss = fmt::format("whether commits are lost since {} of them cannot be told: {}", opened.file.head.commits,
                              runtime::text_of(error));
  }
  if (before && !*before && opened.file.head.commits > 0) {
    spdlog::warn("{} is not there: whether {} has lost commits cannot be told", head_file_of(path).string(),
                 path.string());
  }
  if (opened.loss && opened.file.losses.size() < kMaxLosses) opened.file.losses.push_back({utc_us, *opened.loss});
  opened.problem = try_to_save(path, opened.file);
  return opened;
}

asio::awaitable<void> HeadWatch::open() {
  auto job = [path = path_, utc_us = clock_.utc_us()](Database& database) { return compare(database, path, utc_us); };
  Opened opened = co_await recorder_.on_disk(std::move(job));
  file_ = std::move(opened.file);
  note_problem(std::move(opened.problem));
  if (opened.loss) note(*opened.loss);
  if (!file_.losses.empty()) {
    spdlog::error("{} losses of the database are not acknowledged; the first: {}", file_.losses.size(),
                  file_.losses.front().problem);
  }
}

void HeadWatch::note(const std::string& loss) {
  spdlog::error("{}: {}", path_.string(), loss);
  station::AuditNote note;
  note.by = {"station", "", clock_.utc_us()};
  note.action = "store.loss_noticed";
  note.detail = nlohmann::json{{"problem", loss}}.dump();
  recorder_.on_audit(note);
}

asio::awaitable<void> HeadWatch::run() {
  for (;;) {
    co_await recorder_.next_commit();
    co_await clock_.sleep_for(interval_);
    HeadFile file = file_;
    file.at_us = clock_.utc_us();
    auto job = [path = path_, file, names_hold = recorder_.names_hold()] {
      return write_if_changed(path, file, names_hold);
    };
    Look look = co_await checkpoints_.run(std::move(job));
    if (look.written) file_.head = *look.written;
    note_problem(std::move(look.problem));
  }
}

// The database is at rest: no file appears beside it. What a log still holds is not seen, so the head is behind.
void HeadWatch::close() {
  try {
    SQLite::Database database{reading_uri(path_, true), SQLite::OPEN_READONLY | SQLite::OPEN_URI};
    HeadFile file = file_;
    file.head = read_store_head(database);
    file.at_us = clock_.utc_us();
    if (file.head.commits >= file_.head.commits && file.head != file_.head) save_head_file(path_, file);
  } catch (const std::exception& error) {
    note_problem(runtime::text_of(error));
  }
}

asio::awaitable<Result<void>> HeadWatch::acknowledge(station::Author by) {
  if (file_.losses.empty()) co_return Result<void>{};
  const std::vector<StoreLoss> losses = std::exchange(file_.losses, {});
  auto job = [path = path_, file = file_] { return try_to_save(path, file); };
  const std::string problem = co_await checkpoints_.run(std::move(job));
  if (!problem.empty()) {
    file_.losses = losses;
    co_return fail(ErrorCode::unavailable, problem);
  }
  station::AuditNote note;
  note.by = std::move(by);
  note.action = "store.loss_acknowledged";
  note.detail = nlohmann::json{{"losses", losses.size()}}.dump();
  recorder_.on_audit(note);
  co_return Result<void>{};
}

void HeadWatch::note_problem(std::string problem) {
  if (problem != problem_ && !problem.empty()) {
    spdlog::warn("the head of the database is not written, so a loss may go unnoticed; it is tried again: {}", problem);
  }
  problem_ = std::move(problem);
}

}  // namespace server::storage
