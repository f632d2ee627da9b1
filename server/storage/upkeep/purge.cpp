// DELETE by row numbers and by the segments' index; a slice's gap becomes one with that of the slice before it. Pages
// by incremental vacuum.
#include "server/storage/upkeep/purge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kSegmentsASlice = 4;  // about 1 ms
constexpr int kSegmentSlicesAStep = 25;
constexpr int kPagesASlice = 16;
constexpr int kPageSlicesAStep = 16;  // as many pages as they give back go to the write-ahead log, and others

std::string with_names(const char* sql, const GapTable& table) {
  return fmt::format(fmt::runtime(sql), table.name, table.first, table.last);
}

constexpr const char* kGapBefore =
    "SELECT {1} FROM {0} WHERE boot_key = ?1 AND cause = 'retention' AND {2} = ?2 - 1"
    " AND {1} = (SELECT max({1}) FROM {0} WHERE boot_key = ?1 AND {1} < ?2)";
constexpr const char* kGapAfter = "SELECT {2} FROM {0} WHERE boot_key = ? AND {1} = ? AND cause = 'retention'";
constexpr const char* kRemoveGap = "DELETE FROM {0} WHERE boot_key = ? AND {1} = ?";
constexpr const char* kAddGap =
    "INSERT INTO {0} (boot_key, {1}, {2}, cause, noticed_at_us) VALUES (?, ?, ?, 'retention', ?)";

class Purge {
 public:
  explicit Purge(SQLite::Database& database)
      : rows_{database, "DELETE FROM sample WHERE row BETWEEN ? AND ?"},
        segment_{database, "DELETE FROM segment WHERE boot_key = ? AND first_seq = ?"},
        gaps_{database, {"gap", "first_seq", "last_seq"}} {}

  // Segments of one boot, ascending.
  void remove(const std::vector<StoredSegment>& segments, std::int64_t utc_us) {
    Interval whole;
    for (const StoredSegment& gone : segments) {
      execute(rows_, gone.first_row, gone.last_row);
      execute(segment_, gone.boot_key, gone.samples.first);
      if (whole.next != gone.samples.first && whole.next > 0) gaps_.add(gone.boot_key, whole, utc_us);
      whole = {whole.next == gone.samples.first ? whole.first : gone.samples.first, gone.samples.next};
    }
    if (whole.next > 0) gaps_.add(segments.back().boot_key, whole, utc_us);
  }

 private:
  SQLite::Statement rows_, segment_;
  RetentionGaps gaps_;
};

}  // namespace

RetentionGaps::RetentionGaps(SQLite::Database& database, const GapTable& table)
    : before_{database, with_names(kGapBefore, table)},
      after_{database, with_names(kGapAfter, table)},
      remove_{database, with_names(kRemoveGap, table)},
      add_{database, with_names(kAddGap, table)} {}

void RetentionGaps::add(std::int64_t boot_key, Interval purged, std::int64_t utc_us) {
  bind_all(after_, boot_key, purged.next);
  if (after_.executeStep()) {
    execute(remove_, boot_key, purged.next);
    purged.next = unsigned_id(after_.getColumn(0)) + 1;
  }
  bind_all(before_, boot_key, purged.first);
  if (before_.executeStep()) {
    purged.first = unsigned_id(before_.getColumn(0));
    execute(remove_, boot_key, purged.first);
  }
  after_.reset();
  before_.reset();
  execute(add_, boot_key, purged.first, purged.next - 1, utc_us);
}

std::uint64_t purge_step(SQLite::Database& database, RetentionPlan& plan, const runtime::Clock& clock,
                         std::int64_t utc_us) {
  std::uint64_t removed = 0;
  const std::int64_t end_us = clock.steady_us() + kStepTime.count();
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  RetentionPlan::Step walk{plan, database};
  Purge purge{database};
  for (int slices = 0; slices < kSegmentSlicesAStep && !plan.empty(); ++slices) {
    if (slices > 0 && clock.steady_us() >= end_us) break;
    const std::vector<StoredSegment> going = walk.next(kSegmentsASlice);
    purge.remove(going, utc_us);
    for (const StoredSegment& segment : going) removed += segment.samples.next - segment.samples.first;
  }
  transaction.commit();
  return removed;
}

std::uint64_t shrink_step(SQLite::Database& database, const runtime::Clock& clock) {
  const auto free_pages = [&database] {
    return static_cast<std::uint64_t>(database.execAndGet("PRAGMA freelist_count").getInt64());
  };
  const std::int64_t end_us = clock.steady_us() + kStepTime.count();
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  const std::uint64_t before = free_pages();
  const std::string slice = fmt::format("PRAGMA incremental_vacuum({})", kPagesASlice);
  for (int slices = 0; slices < kPageSlicesAStep; ++slices) {
    if (slices > 0 && clock.steady_us() >= end_us) break;
    database.exec(slice);
  }
  const std::uint64_t after = free_pages();
  transaction.commit();
  return before - std::min(before, after);
}

}  // namespace server::storage
