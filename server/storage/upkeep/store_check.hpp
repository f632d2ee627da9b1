// Checks a database against the promises of docs/database.md, and recomputes each digest.
//
// Reads only, in short transactions, so it works beside a running station without holding its log. On the thread that
// owns the handle, which is in no transaction. Of the present schema version.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

struct StoreCheck {
  std::optional<RunId> run;  // only this one, with the samples of its spans
  // Also let SQLite check every page, in one long read transaction, and compare the extremes of each segment with its
  // samples.
  bool integrity = false;
};

struct StoreFindings {
  std::vector<std::string> faults;  // a line each; empty: the database is as it should be
  std::uint64_t segments = 0;
  std::uint64_t samples = 0;
  std::uint64_t runs_verified = 0;        // their digests were recomputed and agree
  std::uint64_t runs_incomplete = 0;      // have ended; samples are still on their way
  std::uint64_t runs_without_digest = 0;  // complete, and the station has not made the digest yet
};

// not_found when there is no such run.
Result<StoreFindings> check_store(SQLite::Database& database, const StoreCheck& options);

}  // namespace server::storage
