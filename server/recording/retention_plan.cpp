// Walks boots by key and their segments by index, and jumps over what is held.
#include "server/recording/retention_plan.hpp"

#include <algorithm>
#include <limits>

#include "server/recording/statement.hpp"

namespace server {
namespace {

constexpr std::uint64_t kOpenEnd = std::numeric_limits<std::int64_t>::max();
constexpr std::size_t kBootsAtOnce = 500;  // looked at in one call: a walk past many is cut into steps

constexpr const char* kBoots =
    "SELECT boot_key, max(durable_next_seq, coalesce(ended_next_seq, 0)), ended_next_seq IS NULL FROM boot"
    " WHERE boot_key >= ? ORDER BY boot_key LIMIT 500";
constexpr const char* kNewest = "SELECT first_seq FROM segment WHERE boot_key = ? ORDER BY first_seq DESC LIMIT 1";
constexpr const char* kSegment =
    "SELECT first_seq, last_seq, first_row, last_row, received_at_us FROM segment"
    " WHERE boot_key = ? AND first_seq >= ? ORDER BY first_seq LIMIT 1";
constexpr const char* kHeld =
    "SELECT run_span.boot_key, run_span.first_seq, run_span.last_seq FROM run_span JOIN run USING (run_id)"
    " WHERE run.state <> 'discarded'";

}  // namespace

RetentionPlan::RetentionPlan(SQLite::Database& database)
    : boots_{database, kBoots}, newest_{database, kNewest}, segment_{database, kSegment} {
  SQLite::Statement query{database, kHeld};
  while (query.executeStep()) {
    const std::uint64_t next = query.isColumnNull(2) ? kOpenEnd : unsigned_id(query.getColumn(2)) + 1;
    held_[query.getColumn(0).getInt64()].push_back({unsigned_id(query.getColumn(1)), next});
  }
}

std::vector<StoredSegment> RetentionPlan::next(PurgePosition& position, std::int64_t older_than_us, std::size_t limit) {
  std::vector<StoredSegment> found;
  const std::vector<Boot> boots = boots_from(position.boot_key);
  for (const Boot& boot : boots) {
    if (boot.key != position.boot_key) position = {boot.key, 0};
    while (found.size() < limit) {
      const auto segment = first_free(boot, position.seq);
      if (!segment || segment->received_at_us >= older_than_us) break;
      found.push_back(*segment);
      position.seq = segment->samples.next;
    }
    if (found.size() >= limit) return found;
    position = {boot.key + 1, 0};
  }
  finished_ = boots.size() < kBootsAtOnce;
  return found;
}

std::optional<std::int64_t> RetentionPlan::oldest_us() {
  std::optional<std::int64_t> oldest_us;
  std::int64_t boot_key = 0;
  for (std::vector<Boot> boots = boots_from(boot_key); !boots.empty(); boots = boots_from(boot_key)) {
    for (const Boot& boot : boots) {
      const auto segment = first_free(boot, 0);
      if (segment) oldest_us = std::min(oldest_us.value_or(segment->received_at_us), segment->received_at_us);
    }
    boot_key = boots.back().key + 1;
  }
  return oldest_us;
}

// SAFETY: the newest segment of a boot that may go on tells after a restart whether the robot is latched.
std::vector<RetentionPlan::Boot> RetentionPlan::boots_from(std::int64_t boot_key) {
  std::vector<Boot> boots;
  bind_all(boots_, boot_key);
  while (boots_.executeStep()) {
    Boot boot{boots_.getColumn(0).getInt64(), unsigned_id(boots_.getColumn(1))};
    const bool may_go_on = boots_.getColumn(2).getInt() != 0;
    if (may_go_on) {
      bind_all(newest_, boot.key);
      boot.end = newest_.executeStep() ? std::min(boot.end, unsigned_id(newest_.getColumn(0))) : 0;
      newest_.reset();
    }
    boots.push_back(boot);
  }
  return boots;
}

std::optional<StoredSegment> RetentionPlan::first_free(const Boot& boot, std::uint64_t seq) {
  for (;;) {
    bind_all(segment_, boot.key, seq);
    if (!segment_.executeStep()) return std::nullopt;
    const StoredSegment segment{boot.key,
                                {unsigned_id(segment_.getColumn(0)), unsigned_id(segment_.getColumn(1)) + 1},
                                segment_.getColumn(2).getInt64(),
                                segment_.getColumn(3).getInt64(),
                                segment_.getColumn(4).getInt64()};
    segment_.reset();
    if (segment.samples.next > boot.end) return std::nullopt;
    const auto held_until = end_of_hold(segment);
    if (!held_until) return segment;
    if (*held_until == kOpenEnd) return std::nullopt;
    seq = *held_until;
  }
}

std::optional<std::uint64_t> RetentionPlan::end_of_hold(const StoredSegment& segment) const {
  const auto spans = held_.find(segment.boot_key);
  if (spans == held_.end()) return std::nullopt;
  std::optional<std::uint64_t> end;
  for (const Interval& span : spans->second) {
    const bool overlaps = span.first < segment.samples.next && segment.samples.first < span.next;
    if (overlaps) end = std::max(end.value_or(0), span.next);
  }
  return end;
}

}  // namespace server
