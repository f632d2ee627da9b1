// The metrics of runs as they were computed: one row for each run and version of the computation.
//
// A row is replaced when the run has another reference, or more samples than when it was computed; not when retention
// has removed samples since. Loop thread; SQL on the disk thread and the readers'. Recorder and reader outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "server/runtime/result.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

struct StoredMetrics {
  RunId run = 0;
  int version = 0;                // of the computation
  std::string program;            // that computed them
  std::int64_t samples = 0;       // of the run, when they were computed
  std::int64_t reference_us = 0;  // when the outside reference was made that they are measured by; 0: none
  std::int64_t computed_at_us = 0;
  std::string document;  // JSON
};

class MetricsOfRuns {
 public:
  MetricsOfRuns(Recorder& recorder, DatabaseReader& reader) : recorder_{recorder}, reader_{reader} {}

  // Of this version, by this reference, and of at least this number of samples.
  boost::asio::awaitable<std::optional<StoredMetrics>> find(RunId run, int version, std::int64_t samples,
                                                            std::int64_t reference_us);
  // unavailable when the disk cannot be written.
  boost::asio::awaitable<Result<void>> store(StoredMetrics metrics);

 private:
  Recorder& recorder_;
  DatabaseReader& reader_;
};

}  // namespace server::storage
