#include "server/storage/commits/database_worker.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/disk_reserve.hpp"
#include "server/storage/database/file_check.hpp"
#include "server/storage/samples/stored_rows.hpp"

namespace server::storage {
namespace asio = boost::asio;

asio::awaitable<OpenedDatabase> DatabaseWorker::open(std::int64_t utc_us) {
  auto job = [this, utc_us] { return open_now(utc_us); };
  co_return co_await disk_.run(std::move(job));
}

OpenedDatabase DatabaseWorker::open_now(std::int64_t utc_us) {
  const std::filesystem::path folder = std::filesystem::absolute(path_).parent_path();
  std::error_code unknown;  // then it counts as much
  give_up_disk_reserve(path_, std::filesystem::space(folder, unknown).available);
  settle_kept_files(path_);
  database_ = std::make_unique<Database>(path_);
  store_ = std::make_unique<SampleStore>(*database_);
  kept_ = std::make_shared<KeptFiles>(path_, rescue_);
  checkpointer_.set_names_hold([kept = kept_] { return kept->hold(); });
  for (const std::filesystem::path& aside : folders_set_aside(path_)) {
    spdlog::error(
        "{} holds what lost its name while a station worked with it: look whether {} has all of it, "
        "see \"Files that were taken away\" in the manual, and remove that folder",
        aside.string(), path_.string());
  }
  try {
    end_unfinished_commands(*database_, utc_us);
  } catch (const SQLite::Exception& error) {  // SAFETY: with a full disk, too, robots come in and can be stopped
    spdlog::warn("commands of an earlier start stay unfinished in the record: {}", runtime::text_of(error));
  }
  keep_disk_reserve(path_, std::filesystem::space(folder, unknown).available);
  BootStore boots{*database_};
  const std::int64_t next_boot_key = boots.next_boot_key();
  spdlog::info("audit: goes on from {}", text(audit_head(database_->handle())));
  return {.restored = {database_->store_id(), boots.robots(), pending_stops(*database_), {}},
          .next_boot_key = next_boot_key,
          .restored_at_us = database_->restored_at_us()};
}

asio::awaitable<std::string> DatabaseWorker::write(const WriteBatch& commit) {
  auto job = [this, &commit](Database&) { return write_now(commit); };
  co_return co_await run(std::move(job));
}

// The files have their names after a job that wrote, as far as that can be mended; if not, the next commit says so.
void DatabaseWorker::look_after(std::uint64_t commits_before) {
  if (store_->log_use().commits != commits_before) kept_->problem(database_->handle());
}

std::string DatabaseWorker::write_now(const WriteBatch& commit) {
  try {
    if (!is_written_) store_->write(commit);
    is_written_ = true;
    // SAFETY: what is in a file that nobody finds again is not acknowledged.
    std::string problem = kept_->problem(database_->handle());
    is_written_ = !problem.empty();
    return problem;
  } catch (const std::exception& error) {  // disk full, locked, unreadable: never a reason to end the emergency stop
    std::string lost = kept_->hold() ? std::string{} : kept_->problem(database_->handle());
    return lost.empty() ? write_problem(error) : lost;
  }
}

void DatabaseWorker::close(const std::function<void(Database&, std::int64_t)>& last, const runtime::Clock& clock,
                           station::AuditNote stopped) {
  store_.reset();
  kept_->problem(database_->handle());  // a log that has lost its name has it again
  try {
    if (last) last(*database_, clock.utc_us());
    stopped.by.at_us = clock.utc_us();  // it is the last entry
    const AuditHead head = append_audit(database_->handle(), stopped);
    spdlog::info("audit: ends with {}", text(head));
  } catch (const std::exception& error) {
    spdlog::warn("the last words of the audit could not be written: {}", runtime::text_of(error));
  }
  try {
    database_->checkpoint();
  } catch (const std::exception& error) {  // only the log stays longer: it is read at the next start
    spdlog::warn("the write-ahead log of {} could not be emptied: {}", path_.string(), runtime::text_of(error));
  }
  kept_->remove();
  database_.reset();
}

}  // namespace server::storage
