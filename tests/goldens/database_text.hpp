// A SQLite file as SQL text: what it holds, without how its pages are laid out.
#pragma once

#include <filesystem>
#include <string>

namespace server {

// Statements that make the file again: version, tables with their rows, then indexes, views and triggers.
std::string database_text(const std::filesystem::path& path);

// The schema alone, as `.schema` of the sqlite3 shell gives it.
std::string schema_text(const std::filesystem::path& path);

void make_database_of_text(const std::filesystem::path& path, const std::string& text);

}  // namespace server
