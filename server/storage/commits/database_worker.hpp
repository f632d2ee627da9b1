// Owns the writing handle of the database: opens it, runs jobs with it on the disk thread, writes commits, closes it.
//
// Loop thread; what it is given runs on the disk thread. The worker thread and the Checkpointer outlive it; the latter
// learns after each job how long the write-ahead log is. When it is destroyed no job may be under way.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/worker.hpp"
#include "server/station/state/robot_archive.hpp"
#include "server/station/state/station_state.hpp"
#include "server/storage/commits/checkpointer.hpp"
#include "server/storage/database/kept_files.hpp"

namespace server::storage {

// What the station must know again after a restart.
struct RestoredState {
  std::uint64_t store_id = 0;
  std::vector<station::RestoredRobot> robots;
  std::vector<station::CommandRecord> pending_stops;  // emergency stops that no robot has acknowledged
  std::vector<station::Reservation> reservations;     // that are neither over nor cancelled
};

// What the recorder must know, too.
struct OpenedDatabase {
  RestoredState restored;
  std::int64_t next_boot_key = 0;
  std::int64_t restored_at_us = 0;  // UTC; 0: the database is not made of a backup
};

class DatabaseWorker {
 public:
  DatabaseWorker(runtime::WorkerThread& disk, Checkpointer& checkpointer, std::filesystem::path path,
                 RescuePlace rescue = {})
      : disk_{disk}, checkpointer_{checkpointer}, path_{std::move(path)}, rescue_{std::move(rescue)} {}

  // Opens or creates the database; before everything else. Throws when the file is not ours or cannot be written.
  boost::asio::awaitable<OpenedDatabase> open(std::int64_t utc_us);
  bool is_open() const { return store_ != nullptr; }

  // Runs job(Database&) on the disk thread, between two commits.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job, Database&>> run(Job job) {
    LogReport report{checkpointer_};
    auto with_database = [this, &report, job = std::move(job)]() mutable {
      const LogReport::Reading reading{report.use, *store_};
      struct Look {
        DatabaseWorker& worker;
        std::uint64_t commits;
        ~Look() { worker.look_after(commits); }
      };
      const Look look{*this, store_->log_use().commits};
      return job(*database_);
    };
    co_return co_await disk_.run(std::move(with_database));
  }

  // Returns the problem, empty when the commit is durable in files that have their names. It must stay as it is until
  // then.
  boost::asio::awaitable<std::string> write(const WriteBatch& commit);

  // After the loop has ended: the same in this thread; `last` has the database to itself; then the audit gets its last
  // entry, the log is emptied and the database closed. They do not throw.
  std::string write_now(const WriteBatch& commit);
  void close(const std::function<void(Database&, std::int64_t utc_us)>& last, const runtime::Clock& clock,
             station::AuditNote stopped);

 private:
  // After a job of the disk thread, whatever came of it: reports how long the log is.
  struct LogReport {
    explicit LogReport(Checkpointer& to) : checkpointer{to} {}
    ~LogReport() {
      if (use) checkpointer.on_log(*use);  // else it was cancelled before it began
    }
    LogReport(const LogReport&) = delete;
    LogReport& operator=(const LogReport&) = delete;

    struct Reading {  // on the disk thread
      std::optional<LogUse>& use;
      const SampleStore& store;
      ~Reading() { use = store.log_use(); }
    };

    Checkpointer& checkpointer;
    std::optional<LogUse> use;
  };

  OpenedDatabase open_now(std::int64_t utc_us);
  void look_after(std::uint64_t commits_before);

  runtime::WorkerThread& disk_;
  Checkpointer& checkpointer_;
  std::filesystem::path path_;
  RescuePlace rescue_;
  std::shared_ptr<KeptFiles> kept_;     // shared with all who may open the database by its name
  std::unique_ptr<Database> database_;  // used by jobs; by close() when no job can be under way
  std::unique_ptr<SampleStore> store_;
  bool is_written_ = false;  // the commit, but its files have lost their names
};

}  // namespace server::storage
