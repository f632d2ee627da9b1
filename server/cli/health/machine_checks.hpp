// Checks of the doctor on the machine: disk, file system, clock, real-time priority, limits of the system.
//
// Each measurement is apart from its judgement, so that a test can judge what no test machine has. Times are in the
// unit of their name. Errors: none; what cannot be measured is a note.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "server/cli/health/findings.hpp"
#include "server/cli/health/running_station.hpp"
#include "server/config/config.hpp"
#include "server/config/resource_limits.hpp"

namespace server::cli {

struct DiskFacts {
  std::uint64_t free_bytes = 0;
  std::optional<double> sync_ms;  // the median of five; none: the folder cannot be written
};
DiskFacts measure_disk(const std::filesystem::path& data_dir);
void judge_disk(const DiskFacts& facts, const config::Config& config, Findings& findings);

struct ClockFacts {
  std::optional<bool> is_synchronised;  // none: the system does not say
  double step_ms = 0;                   // of the clock against steady time, within a quarter of a second
  std::int64_t now_us = 0;              // UTC
  std::int64_t recorded_us = 0;         // UTC, the latest time that the database knows; 0: none
};
ClockFacts measure_clock();
void judge_clock(const ClockFacts& facts, Findings& findings);

// Of the station that runs, or of what this user would be allowed.
void check_real_time(const RunningStation& running, const config::Config& config, Findings& findings);
void check_limits(const RunningStation& running, const config::Config& config, Findings& findings);
void judge_limits(const config::ResourceLimits& limits, const config::Config& config, Findings& findings);
void judge_file_system(const std::string& unsuitable, const config::Config& config, Findings& findings);

}  // namespace server::cli
