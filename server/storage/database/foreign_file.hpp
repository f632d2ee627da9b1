// A database that somebody else may have written: what it is allowed to do while it is read, and whether its schema is
// one that a version of this program has written. A view or a trigger in it would otherwise run in this
// program.
//
// On the thread that owns the handle. Errors: throws SQLite::Exception.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <optional>
#include <string>

namespace server::storage {

// From now on reading through a view fails, no trigger runs, and what the schema calls is not trusted.
void guard_foreign(SQLite::Database& database);

// What no version wrote, or what is missing, of a station's database, in words: "trigger 'x'". None: its schema is that
// of its user_version, word for word.
std::optional<std::string> strange_in_schema(SQLite::Database& database);

// Whether it is a table whose columns are all stored: a virtual one, a view and a computed column run what somebody
// wrote.
bool is_plain_table(SQLite::Database& database, const std::string& name);

}  // namespace server::storage
