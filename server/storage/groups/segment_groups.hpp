// Groups of segments: the second level of extremes, so that an overview of a day or a month reads hundreds of rows
// instead of every segment.
//
// A window is 6400 numbers of a boot, 64 s at 100 Hz. A group has the extremes of all segments in its window. It is
// made once the window is settled, that is when each of its samples is stored or lost for good, so nothing is ever
// added to it; and it goes with the first of its segments that retention removes (a trigger, in migrations/9.sql). So a
// group that is there is always right, and where there is none the segments are read: in the window that is being
// recorded, in one that retention has cut, and in a database of an earlier version until its groups are made.
//
// On the thread that owns the database handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/storage/samples/channels.hpp"
#include "server/storage/samples/interval_set.hpp"
#include "server/storage/samples/sample_scanner.hpp"

namespace server::storage {

constexpr std::uint64_t kGroupNumbers = 6400;

// Samples that go to a point of an overview together.
struct Extent {
  Interval numbers;           // of the first and after the last one
  std::uint64_t samples = 0;  // that are stored among them
  std::int64_t first_utc_us = 0;
  std::int64_t last_utc_us = 0;
  std::array<float, kOverviewChannels> min{};  // NaN: no finite value, or not asked for
  std::array<float, kOverviewChannels> max{};
};

Extent extent_of(const SegmentHead& head);
// `later` follows.
void join(Extent& extent, const Extent& later);

// Windows of a boot end where its complete segments do (boot_recording.hpp), so a segment is in one window.
Interval group_window(std::int64_t boot_key, std::uint64_t seq);

// In a transaction of the caller, on the disk thread: makes the group of a settled window, unless nothing is stored in
// it, or a segment reaches beyond it (earlier versions made such): there segments are read for ever.
void make_group(SQLite::Database& database, std::int64_t boot_key, Interval window);

// The groups from range.first on whose windows follow one another without a hole, within the range; at most `limit`.
// An extent has the numbers of the window.
struct GroupRun {
  std::vector<Extent> groups;
  std::uint64_t next_group = 0;  // if there are none: where the next one in the range begins, or the end of the range
};
GroupRun read_groups(SQLite::Database& database, std::int64_t boot_key, Interval range, OverviewChannels channels,
                     std::size_t limit);

// Of the boot: the windows of those that are not what its segments say; for `rheonaut verify`.
std::vector<Interval> wrong_groups(SQLite::Database& database, std::int64_t boot_key);

}  // namespace server::storage
