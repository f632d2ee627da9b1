// Begin, copy, verify, name.
#include "server/storage/upkeep/backup.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <cctype>
#include <cerrno>
#include <map>

#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"
#include "server/storage/database/file_check.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::storage {
namespace asio = boost::asio;
namespace fs = std::filesystem;
using namespace asio::experimental::awaitable_operators;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t kMaxNameBytes = 64;
constexpr std::size_t kMaxRecords = 100;
constexpr int kPagesBetweenClockReads = 64;
constexpr int kMaxPagesAStep = 1024;
constexpr microseconds kCopyStepTime = 30ms;
constexpr microseconds kPause = 20ms;  // at least, between two steps: for the commits
constexpr const char* kSuffix = ".sqlite";

bool is_name(const std::string& name) {
  const auto is_letter = [](unsigned char c) { return c < 0x80 && std::isalnum(c) != 0; };
  const auto fits = [&](unsigned char c) { return is_letter(c) || c == '-' || c == '_' || c == '.'; };
  return !name.empty() && name.size() <= kMaxNameBytes && is_letter(static_cast<unsigned char>(name.front())) &&
         std::ranges::all_of(name, fits);
}

std::string part_suffix(std::uint64_t store_id) { return fmt::format(".part-{:016x}", store_id); }

struct CopyStep {
  std::string problem;
  bool complete = false;
  std::uint64_t pages_done = 0;
  std::uint64_t pages_total = 0;
  std::int64_t took_us = 0;
};

// On the disk thread. Whatever goes wrong with the copy ends the copy, and nothing else.
CopyStep make_step(std::unique_ptr<BackupCopy>& copy, const runtime::Clock& clock) {
  CopyStep step;
  const std::int64_t begun_us = clock.steady_us();
  try {
    for (int pages = 0; pages < kMaxPagesAStep && !step.complete; pages += kPagesBetweenClockReads) {
      step.complete = copy->step(kPagesBetweenClockReads);
      if (clock.steady_us() - begun_us >= kCopyStepTime.count()) break;
    }
    step.pages_done = copy->pages_done();
    step.pages_total = copy->pages_total();
  } catch (const std::exception& error) {
    step.problem = fmt::format("the copy cannot be written: {}", runtime::text_of(error));
  }
  if (!step.problem.empty()) copy.reset();
  if (step.complete) copy->finish();
  step.took_us = clock.steady_us() - begun_us;
  return step;
}

// What this station left when it stopped meanwhile.
void remove_parts(const fs::path& folder, std::uint64_t store_id) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator{folder, ignored}) {
    if (entry.path().filename().string().contains(kSuffix + part_suffix(store_id))) fs::remove(entry.path(), ignored);
  }
}

// What can be refused before it begins. Makes the folder, and room in it.
Result<void> check_room(const fs::path& path, const fs::path& database, std::uint64_t store_id) {
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error || ::eaccess(path.parent_path().c_str(), W_OK | X_OK) != 0) {
    return fail(ErrorCode::unavailable,
                fmt::format("no backup can be written into '{}': {}", path.parent_path().string(),
                            runtime::denial(path.parent_path(), error ? error.value() : errno)));
  }
  remove_parts(path.parent_path(), store_id);
  if (fs::exists(path)) return fail(ErrorCode::conflict, fmt::format("'{}' is there already", path.string()));
  const std::uint64_t needed = file_bytes(database);
  const std::uint64_t free = free_bytes_of(path.parent_path());
  if (free >= needed) return {};
  return fail(ErrorCode::unavailable,
              fmt::format("a backup needs {} bytes, {} are free in '{}'", needed, free, path.parent_path().string()),
              "low_space");
}

std::map<std::string, BackupRecord> found_in(const fs::path& folder) {
  std::map<std::string, BackupRecord> found;
  std::error_code absent;
  for (const fs::directory_entry& entry : fs::directory_iterator{folder, absent}) {
    if (entry.path().extension() != kSuffix) continue;
    const std::uint64_t pages = file_bytes(entry.path()) / 4096;
    found[entry.path().stem()] = {entry.path().stem(), BackupState::done, pages, pages, "", entry.path()};
  }
  return found;
}

}  // namespace

const char* text(BackupState value) {
  switch (value) {
    case BackupState::copying: return "copying";
    case BackupState::verifying: return "verifying";
    case BackupState::done: return "done";
    case BackupState::failed: return "failed";
  }
  return "failed";
}

Backups::Backups(asio::io_context& loop, runtime::Clock& clock, Recorder& recorder, runtime::WorkerThread& readers,
                 const DiskWatch& disk_watch, fs::path folder)
    : loop_{loop},
      clock_{clock},
      recorder_{recorder},
      readers_{readers},
      disk_watch_{disk_watch},
      folder_{std::move(folder)} {}

Backups::~Backups() = default;

fs::path Backups::part_of(const fs::path& path) const { return fs::path{path}.concat(part_suffix(store_id_)); }

asio::awaitable<Result<BackupRecord>> Backups::begin(std::string name) {
  if (!is_name(name)) {
    co_return fail(ErrorCode::invalid,
                   fmt::format("a backup's name has 1 to {} letters, digits, '-', '_' or '.', the first a letter or a "
                               "digit",
                               kMaxNameBytes));
  }
  const Result<void> room = disk_watch_.may_begin("a backup");
  if (!room) co_return std::unexpected{room.error()};
  if (busy_) co_return fail(ErrorCode::conflict, "a backup is being made; try again when it is done");
  busy_ = true;
  BackupRecord record;
  record.name = name;
  record.path = folder_ / (name + kSuffix);
  auto check = [path = record.path, database = recorder_.path(), store_id = store_id_]() -> Result<void> {
    try {
      return check_room(path, database, store_id);
    } catch (const std::exception& error) {
      spdlog::error("backups: {}", runtime::text_of(error));
      return fail(ErrorCode::unavailable, "the folder of backups cannot be used; the station's log says why");
    }
  };
  const Result<void> possible = co_await checker_.run(std::move(check));
  if (!possible) {
    busy_ = false;
    co_return std::unexpected{possible.error()};
  }
  std::erase_if(records_, [&](const BackupRecord& known) { return known.name == name; });
  if (records_.size() >= kMaxRecords) records_.erase(records_.begin());
  records_.push_back(record);
  asked_ = true;
  wanted_.notify();
  co_return record;
}

asio::awaitable<std::vector<BackupRecord>> Backups::list() {
  auto look = [folder = folder_] { return found_in(folder); };
  std::map<std::string, BackupRecord> found = co_await readers_.run(std::move(look));
  for (const BackupRecord& record : records_) {
    const bool was_removed = record.state == BackupState::done && !found.contains(record.name);
    if (!was_removed) found[record.name] = record;
  }
  std::vector<BackupRecord> all;
  all.reserve(found.size());
  for (auto& [name, record] : found) all.push_back(std::move(record));
  co_return all;
}

asio::awaitable<void> Backups::run() {
  for (;;) {
    while (!asked_) co_await wanted_.wait();
    asked_ = false;
    BackupRecord& record = records_.back();  // none is added while busy_
    spdlog::info("backup '{}' begins", record.name);
    const std::string problem = co_await make(record);
    record.state = problem.empty() ? BackupState::done : BackupState::failed;
    record.problem = problem;
    busy_ = false;
    if (problem.empty()) {
      spdlog::info("backup '{}' is verified: {}", record.name, record.path.string());
    } else {
      spdlog::error("backup '{}' failed: {}", record.name, problem);
    }
  }
}

asio::awaitable<std::string> Backups::make(BackupRecord& record) {
  std::string problem = co_await copy(record);
  if (problem.empty()) {
    record.state = BackupState::verifying;
    problem = co_await verify(record);
  }
  if (!problem.empty()) {
    auto remove = [part = part_of(record.path)] { remove_draft(part); };
    co_await checker_.run(std::move(remove));
  }
  co_return problem;
}

asio::awaitable<std::string> Backups::copy(BackupRecord& record) {
  auto open = [this, path = part_of(record.path)](Database& database) -> std::string {
    try {
      copy_ = std::make_unique<BackupCopy>(database.handle(), path);
      return {};
    } catch (const std::exception& error) {
      return fmt::format("'{}' cannot be made: {}", path.string(), runtime::text_of(error));
    }
  };
  const std::string problem = co_await recorder_.on_disk(std::move(open));
  if (!problem.empty()) co_return problem;
  for (;;) {
    auto job = [this](Database&) { return make_step(copy_, clock_); };
    const CopyStep step = co_await recorder_.on_disk(std::move(job));
    if (!step.problem.empty()) co_return step.problem;
    record.pages_done = step.pages_done;
    record.pages_total = step.pages_total;
    if (step.complete) {
      auto close = [this] { copy_.reset(); };  // which may wait for a slow disk to take what it has not yet
      co_await checker_.run(std::move(close));
      co_return std::string{};
    }
    if (disk_watch_.state() == SpaceState::critical) {
      auto give_up = [this](Database&) { copy_.reset(); };
      co_await recorder_.on_disk(std::move(give_up));
      co_return disk_watch_.problem();
    }
    const microseconds took{step.took_us};
    co_await clock_.sleep_for(std::max(kPause, took));
  }
}

// The log mode that the copy has taken over would need files beside it to be read.
asio::awaitable<std::string> Backups::verify(const BackupRecord& record) {
  std::unique_ptr<SQLite::Database> copy;
  auto open = [&copy, part = part_of(record.path)]() -> std::string {
    try {
      copy = std::make_unique<SQLite::Database>(part.string(), SQLite::OPEN_READWRITE);
      copy->exec("PRAGMA journal_mode = DELETE");
      return {};
    } catch (const std::exception& error) {
      return fmt::format("the copy cannot be read: {}", runtime::text_of(error));
    }
  };
  std::string problem = co_await checker_.run(std::move(open));
  if (!problem.empty()) co_return problem;
  auto check = [&copy]() -> std::string {
    try {
      return find_damage(*copy);
    } catch (const std::exception& error) {
      return runtime::text_of(error);
    }
  };
  auto checked = co_await (checker_.run(std::move(check)) || interrupt_when_cancelled(*copy));
  problem = std::get<0>(checked);
  if (!problem.empty()) co_return fmt::format("the copy is damaged: {}", problem);
  auto finish = [&copy, path = record.path, part = part_of(record.path)]() -> std::string {
    try {
      copy.reset();
      if (fs::exists(path)) return fmt::format("'{}' is there already", path.string());
      finish_file(part, path);
      return {};
    } catch (const std::exception& error) {
      return runtime::text_of(error);
    }
  };
  co_return co_await checker_.run(std::move(finish));
}

// A check of a large copy takes minutes, and the station waits for no one when it stops.
asio::awaitable<void> Backups::interrupt_when_cancelled(SQLite::Database& database) {
  struct Interrupt {
    SQLite::Database& database;
    ~Interrupt() { sqlite3_interrupt(database.getHandle()); }
  };
  const Interrupt at_the_end{database};
  runtime::Signal never{loop_};
  co_await never.wait();
}

}  // namespace server::storage
