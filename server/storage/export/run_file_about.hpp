// The table `about` of an exported run: what each table, view and column of the file means, for people who have the
// file alone.
//
//   about(name, column_name, meaning)   a row per table and view, whose column_name is NULL, and one per column
//
// A column means the same in each table, unless kMeanings says otherwise of one table.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

namespace server::storage {

// Of all tables and views that `file` has now. A column that no row of kMeanings explains has an empty text; a test
// finds it.
void explain_run_file(SQLite::Database& file);

}  // namespace server::storage
