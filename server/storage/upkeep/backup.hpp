// Backups of the live database: copied between commits, verified, and only then given their name.
//
//   begin("monday") → <folder>/monday.sqlite.part-<store_id> → integrity check, sync → <folder>/monday.sqlite
//
// Stations may have one folder in common: what is not whole bears the number of its store, and each removes its own.
// One at a time. A backup that fails (its disk is full, the copy is damaged) leaves nothing but its record, and does
// not touch the recording. Loop thread; copied on the disk thread, at most 30 ms between two commits; verified on a
// thread of its own. Recorder, clock and watch outlive it; it ends before the recorder closes the database: close().
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/database/backup_copy.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/upkeep/disk_watch.hpp"

namespace server::storage {

enum class BackupState : std::uint8_t { copying, verifying, done, failed };
const char* text(BackupState value);

struct BackupRecord {
  std::string name;
  BackupState state = BackupState::copying;
  std::uint64_t pages_done = 0;
  std::uint64_t pages_total = 0;
  std::string problem;  // of a failed one
  std::filesystem::path path;
};

class Backups {
 public:
  Backups(boost::asio::io_context& loop, runtime::Clock& clock, Recorder& recorder, runtime::WorkerThread& readers,
          const DiskWatch& disk_watch, std::filesystem::path folder);
  ~Backups();

  // Of the recorder's database; before everything else.
  void set_store_id(std::uint64_t store_id) { store_id_ = store_id; }

  // Makes those that were begun, until cancelled.
  boost::asio::awaitable<void> run();

  // Answers before it is made. invalid: a name has 1 to 64 letters, digits, '-', '_' or '.', and begins with none of
  // the last three; conflict: one is being made, or there is one of that name; unavailable: there is no room.
  boost::asio::awaitable<Result<BackupRecord>> begin(std::string name);

  // By name: the files in the folder, and what was begun since the start of the program.
  boost::asio::awaitable<std::vector<BackupRecord>> list();

  bool busy() const { return busy_; }  // one is being made

  // After the loop has ended.
  void close() { copy_.reset(); }

  // Has a job while a copy is verified: for the virtual time of tests.
  const runtime::WorkerThread& checker() const { return checker_; }

 private:
  boost::asio::awaitable<std::string> make(BackupRecord& record);  // the problem, empty when it is done
  boost::asio::awaitable<std::string> copy(BackupRecord& record);  // the same
  boost::asio::awaitable<std::string> verify(const BackupRecord& record);
  boost::asio::awaitable<void> interrupt_when_cancelled(SQLite::Database& database);
  BackupRecord* find(const std::string& name);
  std::filesystem::path part_of(const std::filesystem::path& path) const;

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  Recorder& recorder_;
  runtime::WorkerThread& readers_;
  const DiskWatch& disk_watch_;
  std::filesystem::path folder_;
  std::uint64_t store_id_ = 0;
  std::unique_ptr<BackupCopy> copy_;   // used by one job at a time; by close() when none can be under way
  std::vector<BackupRecord> records_;  // of this program, the latest last; never more than kMaxRecords
  bool busy_ = false;                  // the latest is being made
  bool asked_ = false;                 // begin() has promised what run() has not taken up
  runtime::Signal wanted_{loop_};
  runtime::WorkerThread checker_{"backup", 10};
};

}  // namespace server::storage
