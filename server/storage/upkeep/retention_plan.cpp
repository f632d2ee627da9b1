// Boots are walked by key and segments by index; the parts wait in a heap with the oldest on top.
#include "server/storage/upkeep/retention_plan.hpp"

#include <algorithm>
#include <limits>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::uint64_t kOpenEnd = std::numeric_limits<std::int64_t>::max();
constexpr int kBootsAtOnce = 200;
constexpr std::size_t kPartsAtOnce = 500;

constexpr const char* kSpans =
    "SELECT run_id, boot_key, first_seq, last_seq FROM run_span JOIN run USING (run_id)"
    " WHERE run_id > ? AND run.state <> 'discarded'";
constexpr const char* kBoots =
    "SELECT boot_key, max(durable_next_seq, coalesce(ended_next_seq, 0)), ended_next_seq IS NOT NULL,"
    " (SELECT first_seq FROM segment WHERE segment.boot_key = boot.boot_key ORDER BY segment.first_seq DESC LIMIT 1)"
    " FROM boot WHERE boot_key > ? ORDER BY boot_key LIMIT ?";
constexpr const char* kSegments =
    "SELECT first_seq, last_seq, first_row, last_row, received_at_us FROM segment"
    " WHERE boot_key = ? AND first_seq >= ? AND first_seq < ? ORDER BY first_seq LIMIT ?";
constexpr const char* kBoot =
    "SELECT ended_next_seq IS NOT NULL,"
    " (SELECT min(first_seq) FROM run_span WHERE run_span.boot_key = boot.boot_key AND last_seq IS NULL)"
    " FROM boot WHERE boot_key = ?";

// Adds what runs above this number hold; returns the newest of all runs.
std::int64_t add_held(SQLite::Database& database, std::int64_t above_run, std::map<std::int64_t, IntervalSet>& held) {
  SQLite::Statement spans{database, kSpans};
  bind_all(spans, above_run);
  while (spans.executeStep()) {
    const std::uint64_t next = spans.isColumnNull(3) ? kOpenEnd : unsigned_id(spans.getColumn(3)) + 1;
    held[spans.getColumn(1).getInt64()].insert({unsigned_id(spans.getColumn(2)), next});
  }
  return database.execAndGet("SELECT coalesce(max(run_id), 0) FROM run").getInt64();
}

std::vector<StoredSegment> read_segments(SQLite::Statement& query, std::int64_t boot_key, Interval samples,
                                         std::size_t limit) {
  std::vector<StoredSegment> segments;
  bind_all(query, boot_key, samples.first, samples.next, static_cast<std::uint64_t>(limit));
  while (query.executeStep()) {
    segments.push_back({boot_key,
                        {unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)) + 1},
                        query.getColumn(2).getInt64(),
                        query.getColumn(3).getInt64(),
                        query.getColumn(4).getInt64()});
  }
  query.reset();
  return segments;
}

}  // namespace

bool RetentionPlan::look(SQLite::Database& database) {
  const SQLite::Transaction moment{database};
  if (!newest_run_) read_held(database);
  if (unread_.empty()) read_boots(database);
  read_first_segments(database);
  const bool more = !all_boots_read_ || !unread_.empty();
  if (!more) held_.clear();
  return more;
}

void RetentionPlan::read_held(SQLite::Database& database) { newest_run_ = add_held(database, 0, held_); }

// SAFETY: the newest segment of a boot that may go on shows after a restart whether the robot is latched.
void RetentionPlan::read_boots(SQLite::Database& database) {
  SQLite::Statement boots{database, kBoots};
  bind_all(boots, boot_key_, std::int64_t{kBootsAtOnce});
  int found = 0;
  for (; boots.executeStep(); ++found) {
    boot_key_ = boots.getColumn(0).getInt64();
    if (boots.isColumnNull(3)) continue;  // nothing of it is stored
    std::uint64_t end = unsigned_id(boots.getColumn(1));
    const bool has_ended = boots.getColumn(2).getInt() != 0;
    if (!has_ended) end = std::min(end, unsigned_id(boots.getColumn(3)));
    for (const Interval& free : held_[boot_key_].missing({0, end})) {
      unread_.push_back({boot_key_, free, has_ended, 0});
    }
  }
  all_boots_read_ = found < kBootsAtOnce;
}

void RetentionPlan::read_first_segments(SQLite::Database& database) {
  SQLite::Statement query{database, kSegments};
  for (std::size_t left = kPartsAtOnce; left > 0 && !unread_.empty(); --left) {
    Part part = unread_.back();
    unread_.pop_back();
    const auto first = read_segments(query, part.boot_key, part.samples, 1);
    if (first.empty() || !may_go(first.front(), part)) continue;
    part.first_row = first.front().first_row;
    parts_.push(part);
  }
}

bool RetentionPlan::may_go(const StoredSegment& segment, const Part& part) const {
  const bool is_old = !limit_ || limit_->covers(segment.last_row, segment.received_at_us);
  return is_old && segment.samples.next <= part.samples.next;
}

RetentionPlan::Step::Step(RetentionPlan& plan, SQLite::Database& database)
    : plan_{plan}, boot_{database, kBoot}, segments_{database, kSegments} {
  plan_.newest_run_ = add_held(database, *plan_.newest_run_, plan_.held_);
}

std::vector<StoredSegment> RetentionPlan::Step::next(std::size_t limit) {
  Part part = plan_.parts_.top();
  plan_.parts_.pop();
  if (!is_free(part.boot_key, part.samples.next, part.boot_has_ended)) return {};
  std::vector<StoredSegment> going = read_segments(segments_, part.boot_key, part.samples, limit + 1);
  if (going.size() > limit) {  // the last one is only looked at
    const StoredSegment& after = going.back();
    part.samples.first = after.samples.first;
    part.first_row = after.first_row;
    if (plan_.may_go(after, part)) plan_.parts_.push(part);
    going.pop_back();
  }
  const auto held = plan_.held_.find(part.boot_key);
  std::erase_if(going, [&](const StoredSegment& segment) {
    const bool is_held = held != plan_.held_.end() && !held->second.covered(segment.samples).empty();
    return is_held || !plan_.may_go(segment, part);
  });
  return going;
}

// As it was when the plan was made: no open run has come to this boot, and it has not come back to life.
bool RetentionPlan::Step::is_free(std::int64_t boot_key, std::uint64_t next_seq, bool has_ended) {
  bind_all(boot_, boot_key);
  if (!boot_.executeStep()) return false;
  const bool came_back = has_ended && boot_.getColumn(0).getInt() == 0;
  const bool is_held = !boot_.isColumnNull(1) && unsigned_id(boot_.getColumn(1)) < next_seq;
  boot_.reset();
  return !came_back && !is_held;
}

}  // namespace server::storage
