// Between time and samples: when a sample was made, and which samples of a robot were made in a stretch of time.
//
// On the thread that owns the database handle; a few index look-ups for each boot, whatever its length. The time of a
// sample that is not stored is counted on from the segment before it, in periods. UTC runs back where the station's
// clock was set: a stretch then begins and ends at one of the crossings.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "server/recording/interval_set.hpp"
#include "server/recording/run_queries.hpp"
#include "server/station/station_state.hpp"

namespace server {

struct SampleTime {
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_us = 0;
};

// Empty when nothing of the boot is stored.
std::optional<SampleTime> time_of(SQLite::Database& database, std::int64_t boot_key, std::uint64_t seq);

// Samples of one boot.
struct BootSamples {
  std::int64_t boot_key = 0;
  BootId boot_id = 0;
  Interval samples;
};

// What the robot made in this time, both ends included, boot by boot in their order; also what was lost of it.
std::vector<BootSamples> samples_between(SQLite::Database& database, const RobotId& robot_id, std::int64_t from_us,
                                         std::int64_t to_us);

struct BootSample {
  std::int64_t boot_key = 0;
  BootId boot_id = 0;
  std::uint64_t seq = 0;
};

// The robot's sample at this time, or the last one before; empty when it had made none.
std::optional<BootSample> sample_at(SQLite::Database& database, const BootHeads& heads, const RobotId& robot_id,
                                    std::int64_t utc_us);

// All that a boot is known to have made; empty when the robot has no such boot.
std::optional<BootSamples> samples_of_boot(SQLite::Database& database, const RobotId& robot_id, BootId boot_id);

}  // namespace server
