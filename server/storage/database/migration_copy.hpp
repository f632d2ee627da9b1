// A copy of the database as it is, made before a migration changes it: the way back to the program that wrote it.
//
// It stands beside the database as NAME.schema-N, N the schema's version, and nobody removes it but people. On the
// thread that owns the handle; blocks for as long as it takes to copy the file.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <filesystem>

namespace server::storage {

// `database` is the open file at `path`. The copy is there whole or not at all, and on disk when this returns; a copy
// that is there already is never overwritten: one of this very state will do, beside another one it gets a number.
// Throws std::runtime_error that says how much room there is and is needed, when it is too little. `free_bytes` tells
// how much room a folder has.
using FreeBytes = std::uint64_t (*)(const std::filesystem::path& folder);
std::uint64_t available_bytes(const std::filesystem::path& folder);
void keep_copy_before_migration(SQLite::Database& database, const std::filesystem::path& path, std::int64_t version,
                                FreeBytes free_bytes = available_bytes);

}  // namespace server::storage
