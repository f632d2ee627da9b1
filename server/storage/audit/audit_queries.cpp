// One statement: a window of entries, and of those the ones that match.
#include "server/storage/audit/audit_queries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "server/storage/database/statement.hpp"

namespace server::storage {

AuditPage read_audit(SQLite::Database& database, const AuditFilter& filter) {
  const SQLite::Transaction moment{database};
  AuditPage page;
  page.head = audit_head(database);
  const std::int64_t below = filter.before > 0 ? std::min(filter.before, page.head.entry + 1) : page.head.entry + 1;
  const std::int64_t from = std::max<std::int64_t>(below - kAuditRowsLookedAt, 1);
  SQLite::Statement rows{
      database, fmt::format("SELECT {} FROM audit WHERE entry >= ?1 AND entry < ?2 AND (?3 IS NULL OR robot_id = ?3)"
                            " AND (?4 IS NULL OR actor = ?4)"
                            " AND (?5 IS NULL OR action = ?5 OR substr(action, 1, length(?5) + 1) = ?5 || '.')"
                            " AND (?6 IS NULL OR at_us >= ?6) AND (?7 IS NULL OR at_us < ?7)"
                            " ORDER BY entry DESC LIMIT ?8",
                            kAuditColumns)};
  bind_all(rows, from, below, filter.robot_id, filter.actor, filter.action, filter.from_us, filter.to_us,
           static_cast<std::int64_t>(filter.limit));
  while (rows.executeStep()) {
    if (auto entry = audit_entry_from(rows)) page.entries.push_back(std::move(*entry));
  }
  const bool is_full = page.entries.size() >= filter.limit;
  page.next = is_full ? page.entries.back().entry : from;
  if (page.next <= 1) page.next = 0;
  return page;
}

}  // namespace server::storage
