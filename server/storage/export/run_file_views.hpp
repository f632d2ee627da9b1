// The views of a station's database (docs/database.md) over the tables of an exported run: with the same columns, so
// that a query over views runs on both.
#pragma once

#include <string>

namespace server::storage {

// The SQL that creates them. Where the database that was exported is of an earlier schema, views of copied tables have
// its columns.
std::string run_file_views();

}  // namespace server::storage
