// A database's state at one moment, in a small file beside it: so a store that began anew, a write-ahead log that was
// removed or cut, and an older copy in its place are noticed at the next start, and by `rheonaut verify`.
//
//   station.sqlite → station.head.json
//   {"store_id":"812…","commits":5120,"audit_head":"42:9f86…","at_us":1800000000000000,
//    "losses":[{"noticed_at_us":…,"problem":"…"}]}
//
// A head is read from committed rows and written after that, so it is never ahead of what is durable: a database that
// is behind it has lost commits. It may be older than the database by some seconds, or by a power cut, since the rename
// that puts it in place is not synced. A loss stays in the file until somebody acknowledges it.
//
// Any thread, one writer of a file at a time.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/storage/audit/audit_chain.hpp"

namespace server::storage {

struct StoreHead {
  std::uint64_t store_id = 0;  // 0: none
  std::int64_t commits = 0;    // of the recorder, ever
  AuditHead audit;
  bool operator==(const StoreHead&) const = default;
};

// The database was behind its head.
struct StoreLoss {
  std::int64_t noticed_at_us = 0;  // UTC
  std::string problem;             // a sentence
};

struct HeadFile {
  StoreHead head;
  std::int64_t at_us = 0;         // UTC, when the head was read
  std::vector<StoreLoss> losses;  // nobody has acknowledged them; at most kMaxLosses, the earliest
};
inline constexpr std::size_t kMaxLosses = 8;

std::filesystem::path head_file_of(const std::filesystem::path& database);

// Empty when there is none; an error when it cannot be read or is not one.
Result<std::optional<HeadFile>> load_head_file(const std::filesystem::path& database);
// Replaces it; whole or not at all. Throws std::runtime_error.
void save_head_file(const std::filesystem::path& database, const HeadFile& file);

// Throws SQLite::Exception. The handle is in no transaction.
StoreHead read_store_head(SQLite::Database& database);

// What the database has lost since the head was written, as a sentence; none: it holds all that the head names.
std::optional<std::string> find_loss(SQLite::Database& database, const HeadFile& file);

}  // namespace server::storage
