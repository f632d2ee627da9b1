// Pages of the audit, newest first.
//
// On the thread that owns the handle. A page looks at a bounded number of entries, whether they match or not.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/audit/audit_chain.hpp"

namespace server::storage {

struct AuditFilter {
  std::optional<std::string> robot_id;  // empty text: the station itself
  std::optional<std::string> actor;
  std::optional<std::string> action;    // or all that begin with it and a dot: "control"
  std::optional<std::int64_t> from_us;  // UTC
  std::optional<std::int64_t> to_us;    // not included
  std::int64_t before = 0;              // only entries below; 0: from the newest
  std::size_t limit = 100;              // 1 to 1000
};

struct AuditPage {
  std::vector<AuditEntry> entries;
  std::int64_t next = 0;  // `before` of the next page; 0: there is none
  AuditHead head;         // of the whole chain
};

inline constexpr std::int64_t kAuditRowsLookedAt = 5'000;  // by one page; about 10 ms

AuditPage read_audit(SQLite::Database& database, const AuditFilter& filter);

}  // namespace server::storage
