// Makes the digest of every run that has ended, as soon as each of its samples is stored or known lost.
//
// Loop thread. The samples are read once, in pages, on the readers' thread; the digest is written on the disk
// thread. A run whose robot still holds samples is looked at again after a while, at first often, at last each minute.
// While the disk cannot be written no digest is made. Needs run(); recorder and reader outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/run_digest.hpp"

namespace server::storage {

struct CurrentDigest {
  RunDigest digest;
  bool is_final = false;  // no: samples are on their way, the counts are those of now, and there is no hash
};

class RunDigester {
 public:
  RunDigester(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader);

  // Until cancelled.
  boost::asio::awaitable<void> run();

  // The run has ended.
  void add(RunId run);

  // Waits up to 3 s for a digest that is only not made yet. not_found for an unknown run, conflict for an open one
  // and for one that was discarded without a digest.
  boost::asio::awaitable<Result<CurrentDigest>> find(RunId run);

 private:
  struct Pending {
    std::optional<DigestComputation> begun;
    std::int64_t due_us = 0;    // steady
    std::int64_t delay_us = 0;  // until it is looked at again
    std::uint64_t looks = 0;    // that have ended
  };

  boost::asio::awaitable<void> wait_until_due();
  boost::asio::awaitable<void> look_at(RunId run);
  boost::asio::awaitable<void> count_missed_ticks(RunId run);
  boost::asio::awaitable<bool> store(RunId run, RunDigest digest);
  boost::asio::awaitable<std::optional<RunDigest>> stored(RunId run);
  boost::asio::awaitable<Result<RunDigest>> count(RunId run);  // unavailable: it cannot be read

  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
  runtime::Signal added_;
  std::map<RunId, Pending> pending_;
};

}  // namespace server::storage
