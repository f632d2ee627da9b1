// Restores a backup into a data folder. For the command line: no station runs in the folder, its lock is held.
#pragma once

#include <cstdint>
#include <filesystem>

#include "server/station/state/audit_note.hpp"

namespace server::storage {

struct RestoredStore {
  std::uint64_t store_id = 0;  // a new one: robots see that this is not the store they talked to last
  std::int64_t runs = 0;
  std::int64_t runs_interrupted = 0;  // they were open when the backup was made
  std::int64_t samples = 0;
};

// The database that is not restored to its end yet.
std::filesystem::path restore_draft(const std::filesystem::path& folder);

// Copies the database `from` to station.sqlite in the folder: verified, brought to the present schema, with a new
// store_id, no open run and its own head file (store_head), and visible only when it is whole. Throws
// std::runtime_error that says why not and what to do: there is a database already, the backup is foreign, newer or
// damaged, there is no room.
RestoredStore restore_database(const std::filesystem::path& from, const std::filesystem::path& folder,
                               const station::Author& by);

}  // namespace server::storage
