// Everything that a station's database says of a run itself and of its digest, as texts by the names of the columns.
//
// On the thread that owns the database handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>
#include <utility>
#include <vector>

#include "server/station/state/unknown_values.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

using Facts = std::vector<std::pair<std::string, std::string>>;

// The columns of the view `run`, and those of `run_certificate` after "certificate_"; empty where there is no value.
Facts facts_of_run(SQLite::Database& database, RunId run);

// The texts of the enumerators of the protocol, which have no gap from 0 on.
template <class Enumerator>
std::vector<std::string> enumerator_texts() {
  std::vector<std::string> texts;
  for (int number = 0; number == 0 || !station::is_unknown(static_cast<Enumerator>(number)); ++number) {
    texts.emplace_back(protocol::text(static_cast<Enumerator>(number)));
  }
  return texts;
}

// By "modes" for the field mode: "0 unspecified, 1 idle, …", as enumerator_texts().
Facts enumerator_names();

}  // namespace server::storage
