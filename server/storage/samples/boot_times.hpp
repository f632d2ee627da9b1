// When a sample of a boot was made, and which sample was made at a time.
//
// A boot's UTC is its robot time plus an estimate that is stored with each segment, so a time is looked for by the
// segments, with a few index look-ups, whatever the length of the boot. The time of a sample that is not there is
// counted on from the segment before it, in periods. UTC runs back where the station's clock was set: a time may then
// occur twice, and one of its places is found; a time that occurs is always found.
//
// On the thread that owns the database handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <span>

#include "server/storage/samples/segment.hpp"

namespace server::storage {

struct SampleTime {
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_us = 0;
};

class BootTimes {
 public:
  explicit BootTimes(SQLite::Database& database);

  // From now on those of this boot. `waiting` are segments of it that need not be stored yet; they are read as long as
  // this boot is looked at.
  void enter(std::int64_t boot_key, std::span<const Segment> waiting = {});

  // Both empty: nothing of the boot is there.
  std::optional<SampleTime> of(std::uint64_t seq);
  // The number of the first sample at the time or after it; that of a sample not made yet when the time is later.
  std::optional<std::uint64_t> first_from(std::int64_t utc_us);

 private:
  // Where a segment begins.
  struct Place {
    std::uint64_t seq = 0;
    std::int64_t robot_time_us = 0;
    std::int64_t utc_offset_us = 0;
    std::int64_t period_us = 0;

    std::int64_t utc_us() const { return robot_time_us + utc_offset_us; }
    std::uint64_t first_from(std::int64_t utc_us) const;
  };
  static Place place_of(const Segment& segment);
  std::optional<Place> read(SQLite::Statement& query, std::uint64_t seq) const;

  // The last one that begins at the number or before it, and the first one that begins after it.
  std::optional<Place> at_or_before(std::uint64_t seq);
  std::optional<Place> after(std::uint64_t seq);

  SQLite::Statement at_or_before_;
  SQLite::Statement after_;
  std::span<const Segment> waiting_;
  std::int64_t boot_key_ = 0;
};

}  // namespace server::storage
