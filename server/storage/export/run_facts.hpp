// Everything that a station's database says of a run itself and of its digest, as texts by the names of the columns.
//
// On the thread that owns the database handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>
#include <utility>
#include <vector>

#include "server/storage/runs/run.hpp"

namespace server::storage {

using Facts = std::vector<std::pair<std::string, std::string>>;

// The columns of the view `run`, and those of `run_certificate` after "certificate_"; empty where there is no value.
Facts facts_of_run(SQLite::Database& database, RunId run);

// By "modes" for the field mode: "0 unspecified, 1 idle, …", the enumerators of the protocol without a gap from 0 on.
Facts enumerator_names();

}  // namespace server::storage
