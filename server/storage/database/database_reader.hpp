// A read-only handle of the station's database on a worker's thread, and the way to ask it from the loop.
//
//   auto query = [id](SQLite::Database& database) { return count_rows(database, id); };   // owns copies, at most 20 ms
//   const int rows = co_await reader.ask(std::move(query));
//
// Loop thread. The handle is opened by the first query and used on the worker's thread only. Queries are short, so that
// no read transaction lasts long and a cancelled caller stops the work (a query that has not begun is left out); longer
// work is a series of queries. The worker outlives the reader.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <type_traits>
#include <utility>

#include "server/runtime/worker.hpp"
#include "server/storage/database/database.hpp"

namespace server::storage {

class DatabaseReader {
 public:
  DatabaseReader(std::filesystem::path path, runtime::WorkerThread& worker) : path_{std::move(path)}, worker_{worker} {}

  template <class Query>
  boost::asio::awaitable<std::invoke_result_t<Query, SQLite::Database&>> ask(Query query) {
    ++questions_;
    auto job = [this, query = std::move(query)]() mutable {
      if (!handle_) handle_ = std::make_unique<SQLite::Database>(open_for_reading(path_));
      return query(*handle_);
    };
    co_return co_await worker_.run_unless_cancelled(std::move(job));
  }

  // Runs job() on the same thread: for text that is made of what a query gave.
  template <class Job>
  boost::asio::awaitable<std::invoke_result_t<Job>> run(Job job) {
    co_return co_await worker_.run_unless_cancelled(std::move(job));
  }

  // After the loop's run() has returned: the last connection to close, the writer's, then removes the log.
  void close() { handle_.reset(); }

  std::uint64_t questions() const { return questions_; }  // so far

 private:
  std::filesystem::path path_;
  runtime::WorkerThread& worker_;
  std::unique_ptr<SQLite::Database> handle_;
  std::uint64_t questions_ = 0;
};

}  // namespace server::storage
