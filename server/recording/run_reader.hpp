// Reads a run out of a station's database for a program that is not the station.
//
// Opens the file read-only, so it works while the station runs (the write-ahead log allows that), and goes through the
// view run_sample, which docs/database.md promises. A database that no station has open, closed cleanly, is read as a
// file that does not change: nothing appears beside it, and its folder may be read-only. Blocks; for command-line
// tools.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <vector>

#include "server/recording/runs.hpp"
#include "server/recording/stored_sample.hpp"
#include "server/result.hpp"

namespace server {

// The samples in order of span and seq. not_found: no such file, no such run. invalid: not a station's database, or
// more than limit samples.
Result<std::vector<StoredSample>> read_run(const std::filesystem::path& database, RunId run, std::size_t limit);

// What it rests on, for other tools.
bool lock_is_free(const std::filesystem::path& database);  // no station runs on its folder
bool is_at_rest(const std::filesystem::path& database);    // nor is anything of it in a write-ahead log
SQLite::Database open_at_rest(const std::filesystem::path& database);
// invalid: of another program, or of a version that this one does not know.
Result<void> check_ours(SQLite::Database& database, const std::filesystem::path& path);

}  // namespace server
