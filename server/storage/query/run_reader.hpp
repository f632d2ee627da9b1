// Reads a run out of a station's database for a program that is not the station.
//
// Opens the file read-only, so it works while the station runs (the write-ahead log allows that), and goes through the
// view run_sample, which docs/database.md promises. A database that no station has open, closed cleanly, is read as a
// file that does not change: nothing appears beside it, and its folder may be read-only. Blocks; for command-line
// tools.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/storage/runs/run.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::storage {

// The samples in order of span and seq. not_found: no such file, no such run. invalid: not a station's database, or
// more than limit samples.
Result<std::vector<StoredSample>> read_run(const std::filesystem::path& database, RunId run, std::size_t limit);

// The same of a run's own file of SQLite (export/run_file), whose table `sample` is in this order. invalid: more than
// limit samples, or a table that lacks columns.
Result<std::vector<StoredSample>> read_exported_run(SQLite::Database& file, std::size_t limit);

// Reads something else in the same way. `read` gets the handle and the database as a URI for ATTACH; it begins again
// from nothing when a station has opened the database meanwhile. Its failure is returned.
using ReadStore = std::function<Result<void>(SQLite::Database& database, const std::string& uri)>;
Result<void> read_store(const std::filesystem::path& database, const ReadStore& read);

// The path of a database as a URI that opens it for reading only; at rest: nobody writes.
std::string reading_uri(const std::filesystem::path& path, bool at_rest);

bool lock_is_free(const std::filesystem::path& database);  // no station runs on its folder

}  // namespace server::storage
