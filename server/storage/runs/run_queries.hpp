// Runs as they are stored, with the counts of their samples.
//
// On the thread that owns the database handle; reads only. The counts of a run that has a digest are the
// digest's, so a list of ended runs reads no segment; those of any other run are summed over its segments.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/runs/run.hpp"

namespace server::storage {

// One above the newest sample of each boot in use, as the recorder knows it.
using BootHeads = std::map<station::BootId, std::uint64_t>;

std::optional<Run> find_run(SQLite::Database& database, const BootHeads& heads, RunId id);
// None: the run is of no experiment, or there is no such run.
std::optional<PerformedProfile> read_performed_profile(SQLite::Database& database, RunId id);
// Of a database of any schema. Empty: none, or there is no such run.
std::vector<InterruptedPart> read_interrupted_parts(SQLite::Database& database, RunId id);
std::optional<RunState> read_run_state(SQLite::Database& database, RunId id);
std::vector<Run> list_runs(SQLite::Database& database, const BootHeads& heads, const RunFilter& filter);

// Of the robot's newest run that states the pump's flow; runs that were made afterwards are of an earlier time.
std::optional<RunConditions> last_flow_of(SQLite::Database& database, const station::RobotId& robot_id);

// A run that was open when the station stopped, or was killed.
struct InterruptedRun {
  RunId id = 0;
  station::RobotId robot_id;
  std::string name;
  std::string fluid;
  std::optional<std::int64_t> last_sample_at_us;  // UTC; empty: it has no sample
};

std::vector<InterruptedRun> read_interrupted(SQLite::Database& database, const std::vector<RunId>& ids);
// Which were interrupted since the station started last, as the newest 10,000 entries of the audit say.
std::vector<RunId> interrupted_since_start(SQLite::Database& database);

std::optional<RunSnapshot> read_snapshot(SQLite::Database& database, RunId id);

// One above the newest sample that the boot is known to have made.
std::uint64_t known_next_seq(SQLite::Database& database, station::BootId boot_id);  // 0: there is no such boot
std::uint64_t known_next_seq(SQLite::Database& database, const BootHeads& heads, std::int64_t boot_key,
                             station::BootId boot_id);

// The columns of `run`, in the order in which a row of it is read.
extern const char* const kRunColumns;

}  // namespace server::storage
