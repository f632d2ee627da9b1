// The extremes of a group are a BLOB: for each channel of an overview, by index, the least and the largest value as
// binary32, little-endian. One that an earlier version wrote is shorter; the channels after its end are NaN.
#include "server/storage/groups/segment_groups.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "server/storage/database/schema.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

static_assert(std::endian::native == std::endian::little, "a BLOB of extremes is little-endian");

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

using GroupExtremes = std::array<float, 2 * kOverviewChannels>;  // least and largest value of each channel

GroupExtremes blob_of(const Extent& extent) {
  GroupExtremes extremes{};
  for (std::size_t index = 0; index < kOverviewChannels; ++index) {
    extremes[2 * index] = extent.min[index];
    extremes[2 * index + 1] = extent.max[index];
  }
  return extremes;
}

void read_blob(sqlite3_stmt* row, int column, OverviewChannels channels, Extent& into) {
  GroupExtremes extremes;
  extremes.fill(kNaN);
  const void* blob = sqlite3_column_blob(row, column);
  const auto bytes = static_cast<std::size_t>(sqlite3_column_bytes(row, column));
  if (blob != nullptr) std::memcpy(extremes.data(), blob, std::min(bytes, sizeof extremes));
  for (std::size_t index = 0; index < kOverviewChannels; ++index) {
    into.min[index] = channels[index] ? extremes[2 * index] : kNaN;
    into.max[index] = channels[index] ? extremes[2 * index + 1] : kNaN;
  }
}

// Of all segments in the window; none: nothing is stored in it, or a segment reaches beyond it.
std::optional<Extent> extent_in(SQLite::Database& database, std::int64_t boot_key, Interval window) {
  const std::vector<SegmentHead> heads = read_heads(database, boot_key, window, OverviewChannels{}.set());
  if (heads.empty() || heads.front().first_seq < window.first || heads.back().next_seq > window.next) return {};
  Extent extent = extent_of(heads.front());
  for (std::size_t index = 1; index < heads.size(); ++index) join(extent, extent_of(heads[index]));
  return extent;
}

bool is_same(const Extent& one, const Extent& other) {
  const auto has_same = [](float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  return one.samples == other.samples && one.first_utc_us == other.first_utc_us &&
         one.last_utc_us == other.last_utc_us && std::ranges::equal(one.min, other.min, has_same) &&
         std::ranges::equal(one.max, other.max, has_same);
}

}  // namespace

Extent extent_of(const SegmentHead& head) {
  const std::uint64_t last = head.next_seq - 1 - head.first_seq;
  Extent extent;
  extent.numbers = {head.first_seq, head.next_seq};
  extent.samples = last + 1;
  extent.first_utc_us = static_cast<std::int64_t>(head.first_robot_time_us) + head.utc_offset_us;
  extent.last_utc_us = extent.first_utc_us + static_cast<std::int64_t>(last * head.period_us);
  extent.min = head.min;
  extent.max = head.max;
  return extent;
}

// fmin and fmax pass over NaN.
void join(Extent& extent, const Extent& later) {
  extent.numbers.next = later.numbers.next;
  extent.samples += later.samples;
  extent.last_utc_us = later.last_utc_us;
  for (std::size_t index = 0; index < kOverviewChannels; ++index) {
    extent.min[index] = std::fmin(extent.min[index], later.min[index]);
    extent.max[index] = std::fmax(extent.max[index], later.max[index]);
  }
}

Interval group_window(std::int64_t boot_key, std::uint64_t seq) {
  const std::uint64_t shift = kBootsApart * static_cast<std::uint64_t>(boot_key - 1) % kMaxSegmentSamples;
  const std::uint64_t begin = (seq + shift) / kGroupNumbers * kGroupNumbers;
  return {begin - std::min(begin, shift), begin + kGroupNumbers - shift};
}

void make_group(SQLite::Database& database, std::int64_t boot_key, Interval window) {
  const std::optional<Extent> group = extent_in(database, boot_key, window);
  if (!group) return;
  SQLite::Statement insert{database,
                           "INSERT OR REPLACE INTO segment_group (boot_key, first_seq, last_seq, samples, first_utc_us,"
                           " last_utc_us, extremes) VALUES (?,?,?,?,?,?,?)"};
  bind_all(insert, boot_key, window.first, window.next - 1, group->samples, group->first_utc_us, group->last_utc_us);
  const GroupExtremes extremes = blob_of(*group);
  insert.bind(7, extremes.data(), static_cast<int>(sizeof extremes));
  insert.exec();
}

GroupRun read_groups(SQLite::Database& database, std::int64_t boot_key, Interval range, OverviewChannels channels,
                     std::size_t limit) {
  constexpr const char* kQuery =
      "SELECT first_seq, last_seq, samples, first_utc_us, last_utc_us, extremes FROM segment_group"
      " WHERE boot_key = ?1 AND first_seq >= ?2 AND first_seq < ?3 ORDER BY first_seq";
  GroupRun run{.groups = {}, .next_group = range.next};
  const RawStatement statement = prepare_raw(database, kQuery);
  sqlite3_stmt* row = statement.get();
  sqlite3_bind_int64(row, 1, boot_key);
  sqlite3_bind_int64(row, 2, signed_id(range.first));
  sqlite3_bind_int64(row, 3, signed_id(range.next));
  std::uint64_t next = range.first;
  while (run.groups.size() < limit) {
    const int result = sqlite3_step(row);
    if (result == SQLITE_DONE) break;
    if (result != SQLITE_ROW) fail_with(database);
    const Interval window{unsigned_at(row, 0), unsigned_at(row, 1) + 1};
    if (window != group_window(boot_key, window.first)) continue;  // damaged: as if it was not there
    if (window.next > range.next) break;
    if (window.first != next) {
      if (run.groups.empty()) run.next_group = window.first;
      break;
    }
    Extent& group = run.groups.emplace_back();
    group.numbers = window;
    group.samples = unsigned_at(row, 2);
    group.first_utc_us = sqlite3_column_int64(row, 3);
    group.last_utc_us = sqlite3_column_int64(row, 4);
    read_blob(row, 5, channels, group);
    next = window.next;
  }
  return run;
}

std::vector<Interval> wrong_groups(SQLite::Database& database, std::int64_t boot_key) {
  constexpr std::size_t kAtOnce = 1000;
  constexpr std::uint64_t kEnd = std::numeric_limits<std::int64_t>::max();
  std::vector<Interval> wrong;
  SQLite::Statement rows{database,
                         "SELECT first_seq, last_seq FROM segment_group WHERE boot_key = ? ORDER BY first_seq"};
  bind_all(rows, boot_key);
  while (rows.executeStep()) {
    const Interval window{unsigned_id(rows.getColumn(0)), unsigned_id(rows.getColumn(1)) + 1};
    if (window != group_window(boot_key, window.first)) wrong.push_back(window);
  }
  for (std::uint64_t next = 0; next < kEnd;) {
    const SQLite::Transaction moment{database};
    const GroupRun run = read_groups(database, boot_key, {next, kEnd}, OverviewChannels{}.set(), kAtOnce);
    for (const Extent& group : run.groups) {
      const std::optional<Extent> found = extent_in(database, boot_key, group.numbers);
      if (!found || !is_same(*found, group)) wrong.push_back(group.numbers);
    }
    next = run.groups.empty() ? run.next_group : run.groups.back().numbers.next;
  }
  return wrong;
}

}  // namespace server::storage
