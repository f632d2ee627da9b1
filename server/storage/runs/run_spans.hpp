// Converts between times and samples of a robot over its boots, for markers and runs made afterwards.
//
// On the thread that owns the database handle; a few index look-ups for each boot, whatever its length.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/station/state/station_state.hpp"
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/samples/boot_times.hpp"
#include "server/storage/samples/interval_set.hpp"

namespace server::storage {

// Empty when nothing of the boot is stored.
std::optional<SampleTime> time_of(SQLite::Database& database, std::int64_t boot_key, std::uint64_t seq);

// Samples of one boot.
struct BootSamples {
  std::int64_t boot_key = 0;
  station::BootId boot_id = 0;
  Interval samples;
};

struct BootSample {
  std::int64_t boot_key = 0;
  station::BootId boot_id = 0;
  std::uint64_t seq = 0;
};

// The robot's sample at this time, or the last one before; empty when it had made none.
std::optional<BootSample> sample_at(SQLite::Database& database, const BootHeads& heads,
                                    const station::RobotId& robot_id, std::int64_t utc_us);

// All that a boot is known to have made; empty when the robot has no such boot.
std::optional<BootSamples> samples_of_boot(SQLite::Database& database, const station::RobotId& robot_id,
                                           station::BootId boot_id);

// What a range stands for, and what is known of the robot where it begins.
struct RecordedSamples {
  std::vector<BootSamples> boots;  // in their order; also what was lost
  bool by_time = false;            // so something of each boot was stored when it was found
  std::string firmware_version;
  std::uint32_t controller_id = 0;
  std::int64_t started_at_us = 0;  // UTC
  std::int64_t ended_at_us = 0;
};

// Finds the samples of a range, some boots in each call, so that a reader can do it in short questions.
class RangeSearch {
 public:
  RangeSearch(station::RobotId robot_id, RecordedRange range) : robot_id_{std::move(robot_id)}, range_{range} {}

  // True: there is more to look at.
  bool advance(SQLite::Database& database);
  // After that. invalid when nothing was recorded there, not_found for a boot that the robot has not had.
  Result<RecordedSamples> take() { return std::move(found_); }

 private:
  bool search_time(SQLite::Database& database, const TimeSpan& time);
  void search_boot(SQLite::Database& database, const SeqSpan& named);
  void describe(SQLite::Database& database);

  station::RobotId robot_id_;
  RecordedRange range_;
  std::int64_t boot_key_ = 0;  // of the last boot looked at
  Result<RecordedSamples> found_;
};

}  // namespace server::storage
