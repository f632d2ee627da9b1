// What the doctor checks of the database, read-only: its schema, its pages, the losses beside it, and the robots in it.
//
// Beside a running station the check of pages ends after 5 s, so that its write-ahead log does not grow. Errors: none;
// what cannot be read is a finding.
#pragma once

#include <cstdint>
#include <filesystem>

#include "server/cli/health/findings.hpp"
#include "server/cli/health/running_station.hpp"

namespace server::cli {

// Returns the latest UTC time that it knows of, in µs; 0: none.
std::int64_t check_database(const std::filesystem::path& database, Findings& findings);
// Those in use: whether any ever came, who is connected, who was refused, their firmware. `now_us` is UTC.
void check_robots(const std::filesystem::path& database, const RunningStation& running, std::int64_t now_us,
                  Findings& findings);

}  // namespace server::cli
