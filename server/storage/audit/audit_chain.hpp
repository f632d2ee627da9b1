// The audit: entries that are only ever appended, each with a hash over its content and one over all that came before.
//
//   hash of entry n = BLAKE2b-256(hash of entry n - 1 · n · content_hash)           before entry 1: 32 zero bytes
//   content_hash    = BLAKE2b-256("rheonaut-audit-1\n" · salt · at_us · actor · peer · robot_id · action · subject
//                                 · detail)
//   where a number has 8 bytes, little-endian; a text is its length in bytes, a number, and then its bytes in UTF-8
//
// So one hash of the chain proves all that was written up to it: docs/database.md. The salt keeps the content of an
// entry secret from readers of its content_hash.
//
// On the thread that owns the handle. The chain's head is read from the table for each entry, inside the transaction
// that it is part of: a transaction that fails takes its entries, and nothing else, with it. Throws SQLite::Exception.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"

namespace server::storage {

using AuditHash = std::array<unsigned char, 32>;
using AuditSalt = std::array<unsigned char, 16>;

struct AuditEntry {
  std::int64_t entry = 0;
  station::AuditNote note;
  AuditSalt salt{};
  AuditHash content_hash{};
  AuditHash hash{};
};

// The last entry of a chain, or any one by which it is known.
struct AuditHead {
  std::int64_t entry = 0;  // 0: there is none yet
  AuditHash hash{};
  bool operator==(const AuditHead&) const = default;
};
std::string text(const AuditHash& hash);  // hexadecimal, lower case
std::string text(const AuditHead& head);  // "42:9f86…", as verify --expect takes it
Result<AuditHead> parse_audit_head(const std::string& text);

AuditHash content_hash_of(const station::AuditNote& note, const AuditSalt& salt);
AuditHash link_hash_of(const AuditHash& before, std::int64_t entry, const AuditHash& content_hash);

// In the order in which audit_entry_from() reads them.
inline constexpr const char* kAuditColumns =
    "entry, at_us, actor, peer, robot_id, action, subject, detail, salt, content_hash, hash";
// Empty when a column has not the type that it must have: somebody has changed it.
std::optional<AuditEntry> audit_entry_from(SQLite::Statement& row);

AuditHead audit_head(SQLite::Database& database);

class AuditChain {
 public:
  explicit AuditChain(SQLite::Database& database);

  // In the caller's transaction. Returns the entry's number.
  std::int64_t append(const station::AuditNote& note);

 private:
  SQLite::Statement head_;
  SQLite::Statement insert_;
};

// The same in a transaction of its own. Returns the head then.
AuditHead append_audit(SQLite::Database& database, const station::AuditNote& note);

}  // namespace server::storage
