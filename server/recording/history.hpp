// What was recorded, for people and programs: samples of a run, events, commands, gaps.
//
// Loop thread; the queries run on a worker with a read-only connection, each a page, so no read transaction lives long.
// A query first lets the recorder commit what it has received (only queries of samples and gaps the samples), so an
// answer holds everything up to its question; while the disk fails it comes after 3 s, with what is stored.
// Needs a running Recorder, which has opened the database; recorder and worker outlive it.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "server/recording/runs.hpp"
#include "server/recording/stored_sample.hpp"
#include "server/result.hpp"
#include "server/worker.hpp"

namespace server {

// Where a page ended: the span and seq of its last sample. A page begins after it.
struct SampleCursor {
  std::uint32_t span = 0;
  std::uint64_t seq = 0;
};

struct SamplePage {
  std::vector<StoredSample> samples;
  std::optional<SampleCursor> next;  // empty: the end
};

struct Gap {
  BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
  std::string cause;
  std::int64_t noticed_at_us = 0;
};

class History {
 public:
  History(std::filesystem::path database, Recorder& recorder, WorkerThread& readers);
  ~History();

  // At most `limit` samples (1 to 10000) of a run, in order of span and seq, after the cursor.
  boost::asio::awaitable<Result<SamplePage>> samples(RunId run, std::optional<SampleCursor> after, std::size_t limit);
  boost::asio::awaitable<Result<std::vector<Gap>>> gaps(RunId run);

  // Newest first, at most `limit` (1 to 1000).
  boost::asio::awaitable<std::vector<RobotEvent>> events(RobotId robot_id, std::size_t limit);
  boost::asio::awaitable<std::vector<CommandRecord>> commands(RobotId robot_id, std::size_t limit);
  boost::asio::awaitable<Result<CommandRecord>> command(CommandId id);

  // Returns when every command and event that the recorder has heard is durable, or after 3 s when the disk fails.
  boost::asio::awaitable<void> settle();

  // Runs job() on the readers' thread: for text that is made of what a query gave.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job>> on_reader(Job job) {
    co_return co_await readers_.run(std::move(job));
  }

 private:
  template <class Query>
  boost::asio::awaitable<std::invoke_result_t<Query, SQLite::Database&>> ask(Query query);

  std::filesystem::path path_;
  Recorder& recorder_;
  WorkerThread& readers_;
  std::unique_ptr<SQLite::Database> database_;  // opened by the first query; used on the readers' thread only
};

}  // namespace server
