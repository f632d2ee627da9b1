// Whether a file may be opened as the station's database, judged by its bytes before SQLite opens it; and what damage
// is called.
//
// SQLite carries out what a crash has left beside a file (a journal, a log) as soon as it reads it. What is not ours is
// therefore refused before: file, journal and log stay byte for byte. Any thread.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <exception>
#include <filesystem>
#include <optional>
#include <string>

namespace server::storage {

// Why it is refused: not SQLite, of another program, of a newer Rheonaut, truncated. None when there is no file, when
// it is blank, or ours. Ours in the write-ahead log only looks blank here: then SQLite has to decide.
std::optional<std::string> file_problem(const std::filesystem::path& path);

// SQLite deletes a write-ahead log whose database is gone. Restoring that database needs its log, so this renames
// the log. Returns the new name; none when there is nothing to keep. Throws std::filesystem::filesystem_error.
std::optional<std::filesystem::path> set_aside_orphaned_log(const std::filesystem::path& path);

// Whether the error says that the file does not hold what SQLite wrote.
bool means_damage(const std::exception& error);

// What people read when the database cannot be written: the error, and what to do about it.
std::string write_problem(const std::exception& error);

// What is wrong in a database, an empty text when nothing is. Reads all of it. Its own handle, in no transaction.
std::string find_damage(SQLite::Database& database);

inline constexpr const char* kDamageRemedy = "stop the station, run rheonaut verify, restore a backup";

}  // namespace server::storage
