// Runs and their spans in the database.
//
// Disk thread only. Uses the Database, which outlives it. An open run has exactly one open span; BootStore::start moves
// it to a new boot.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "server/recording/database.hpp"
#include "server/recording/runs.hpp"

namespace server {

class RunStore {
 public:
  // One above the newest sample of each boot in use, as the recorder knows it.
  using Heads = std::map<BootId, std::uint64_t>;

  RunStore(Database& database, Heads heads) : handle_{database.handle()}, heads_{std::move(heads)} {}

  std::map<RobotId, RunId> open_runs();

  // Stores a run with its one open span and sets its id. not_connected when that boot has ended meanwhile.
  Result<RunId> add(const Run& run);

  // Closes the open span at the newest sample (a span without samples is dropped) and the run.
  void end(RunId id, const std::string& verdict, std::int64_t utc_us);

  std::optional<Run> find(RunId id);
  std::vector<Run> list(const std::optional<RobotId>& robot_id, RunId before, std::size_t limit);

 private:
  std::vector<Run> read_runs(SQLite::Statement& query);
  void read_spans(Run& run);
  std::uint64_t next_seq(std::int64_t boot_key, BootId boot_id);
  std::int64_t count_stored(std::int64_t boot_key, std::uint64_t first_seq, std::uint64_t last_seq);
  std::int64_t count_lost(std::int64_t boot_key, std::uint64_t first_seq, std::uint64_t last_seq);

  SQLite::Database& handle_;
  Heads heads_;
};

}  // namespace server
