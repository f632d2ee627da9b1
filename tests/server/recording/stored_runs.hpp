// What a database says of its runs and boots, in a form in which two states of it can be compared.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace server {

// Every column of every sample, gap and event of each run that is not discarded, as text, by run.
std::map<std::int64_t, std::vector<std::string>> stored_runs(SQLite::Database& database);

// A sentence for each sample below a boot's durable_next_seq that stands in none, or in more than one, of segment and
// gap, and for rows that belong to no segment.
std::vector<std::string> coverage_faults(SQLite::Database& database);

}  // namespace server
