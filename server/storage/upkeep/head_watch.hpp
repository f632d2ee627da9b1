// Keeps the head of the database in a file beside it (store_head), and reports when the database is behind it.
//
// Whatever it finds, the station records and carries commands. A loss is reported until an admin acknowledges it, over
// restarts, too. A head that cannot be written stays as it is, behind the database. Loop thread; reads and writes on
// the checkpoints' thread. Clock, recorder and worker outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/upkeep/store_head.hpp"

namespace server::storage {

class HeadWatch {
 public:
  HeadWatch(runtime::Clock& clock, Recorder& recorder, runtime::WorkerThread& checkpoints, microseconds interval);

  // After the recorder's open(): compares the database with its head, and writes the present one.
  boost::asio::awaitable<void> open();
  // Writes the head `interval` after a commit, so once in that time at most, until cancelled.
  boost::asio::awaitable<void> run();
  // After the recorder's close(): writes the last one. Does not throw.
  void close();

  // That nobody has acknowledged.
  const std::vector<StoreLoss>& losses() const { return file_.losses; }
  // unavailable: the file cannot be written, and the losses stay.
  boost::asio::awaitable<Result<void>> acknowledge(station::Author by);

 private:
  struct Opened;
  static Opened compare(Database& database, const std::filesystem::path& path, std::int64_t utc_us);
  void note(const std::string& loss);
  void note_problem(std::string problem);

  runtime::Clock& clock_;
  Recorder& recorder_;
  runtime::WorkerThread& checkpoints_;
  microseconds interval_;
  std::filesystem::path path_;  // of the database
  HeadFile file_;               // as it was written last
  std::string problem_;         // of the latest try to write it; empty: none
};

}  // namespace server::storage
