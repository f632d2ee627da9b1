// A command's row, and with each state of it that is stored an entry of the audit, which says the same.
//
// On the thread that owns the handle, in the caller's transaction. Throws SQLite::Exception.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include "server/station/state/station_state.hpp"
#include "server/storage/audit/audit_chain.hpp"

namespace server::storage {

// "command." and the state; the detail says what was asked for and when each stage was reached.
station::AuditNote audit_note_of(const station::CommandRecord& command);

class CommandStore {
 public:
  explicit CommandStore(SQLite::Database& database);

  // Replaces what is stored of the same command.
  void write(const station::CommandRecord& command, AuditChain& audit);

 private:
  SQLite::Statement upsert_;
};

}  // namespace server::storage
