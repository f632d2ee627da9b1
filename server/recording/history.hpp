// What was recorded, for people and programs: samples of a run, events, commands, gaps.
//
// Loop thread; the queries run on a worker with a read-only connection, each a page, so no read transaction lives long.
// An answer holds everything up to its question. Samples and gaps that are not stored yet are joined from the
// recorder's memory, so that a page which polls neither writes nor cuts a segment short. Queries of events and commands
// let the recorder commit those first; while the disk fails they answer after 3 s, with what is stored.
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
#include "server/recording/span_reader.hpp"
#include "server/result.hpp"
#include "server/worker.hpp"

namespace server {

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
  // From this index on, as the database has them.
  boost::asio::awaitable<Result<std::vector<RecordedSpan>>> spans_of(RunId run, std::uint32_t first_span);

  std::filesystem::path path_;
  Recorder& recorder_;
  WorkerThread& readers_;
  std::unique_ptr<SQLite::Database> database_;  // opened by the first query; used on the readers' thread only
};

}  // namespace server
