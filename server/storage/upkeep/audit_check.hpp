// Checks that a chain of audit entries is complete, and that the commands agree with their audit entries.
//
// Reads only, page by page in short transactions and in bounded memory, so it works beside a running station. On the
// thread that owns the handle, which is in no transaction.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/audit/audit_chain.hpp"

namespace server::storage {

struct AuditFindings {
  // Of the chain at most one, where it first is not as it was written; what comes after is not looked at.
  std::vector<std::string> faults;
  std::uint64_t entries = 0;
  std::uint64_t hidden = 0;    // of them, in an export: only their hashes are shown
  std::uint64_t commands = 0;  // compared with the last entry of each
  AuditHead head;              // the last good entry
};

// Of a station's database of the present schema. `expected` is an entry as it once was: with it, a tail that was
// removed is found, and a chain that was written anew.
AuditFindings check_audit(SQLite::Database& database, const std::optional<AuditHead>& expected);

// Of a run's export (RunFile): the part of the chain that is in it.
AuditFindings check_exported_audit(SQLite::Database& exported, const std::optional<AuditHead>& expected);

}  // namespace server::storage
