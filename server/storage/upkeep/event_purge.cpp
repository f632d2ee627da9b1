// One query for what may go, of some hundred rows at a time; gaps of cause `retention` grow with it.
#include "server/storage/upkeep/event_purge.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/upkeep/purge.hpp"

namespace server::storage {
namespace {

constexpr std::int64_t kRowsASlice = 50;
constexpr int kSlicesAStep = 100;

// SAFETY: a boot's last event of its latch shows after a restart whether the robot is latched.
constexpr const char* kOldest =
    "SELECT event_row, boot_key, event_seq, received_at_us,"
    " CASE WHEN event_seq IS NULL THEN EXISTS (SELECT 1 FROM run WHERE run.robot_id = event.robot_id"
    "   AND state <> 'discarded' AND started_at_us <= received_at_us"
    "   AND coalesce(ended_at_us, 9223372036854775807) >= received_at_us)"
    "  OR (kind IN ('experiment_interrupted', 'experiment_paused') AND EXISTS (SELECT 1 FROM run_span JOIN run USING "
    "(run_id)"
    "   WHERE run_span.boot_key = event.boot_key AND state <> 'discarded'))"
    " ELSE EXISTS (SELECT 1 FROM run_span JOIN run USING (run_id) WHERE run_span.boot_key = event.boot_key"
    "   AND state <> 'discarded' AND first_seq <= sample_seq"
    "   AND coalesce(last_seq, 9223372036854775807) >= sample_seq)"
    "  OR event_seq = (SELECT max(event_seq) FROM event AS latch WHERE latch.boot_key = event.boot_key"
    "   AND event_seq IS NOT NULL AND kind IN ('emergency', 'emergency_cleared'))"
    "  OR event_seq >= (SELECT durable_next_event_seq FROM boot WHERE boot.boot_key = event.boot_key) END"
    " FROM event WHERE event_row > ? ORDER BY event_row LIMIT ?";

struct OldEvent {
  std::int64_t row = 0;
  std::int64_t boot_key = 0;  // 0: of the station
  std::uint64_t event_seq = 0;
  std::int64_t received_at_us = 0;
  bool is_held = false;
};

std::vector<OldEvent> oldest(SQLite::Statement& query, std::int64_t after_row) {
  std::vector<OldEvent> events;
  bind_all(query, after_row, kRowsASlice);
  while (query.executeStep()) {
    const bool is_of_station = query.isColumnNull(2);
    events.push_back({query.getColumn(0).getInt64(), is_of_station ? 0 : query.getColumn(1).getInt64(),
                      unsigned_id(query.getColumn(2)), query.getColumn(3).getInt64(),
                      query.getColumn(4).getInt() != 0});
  }
  query.reset();
  return events;
}

class Removal {
 public:
  explicit Removal(SQLite::Database& database)
      : remove_{database, "DELETE FROM event WHERE event_row = ?"},
        gaps_{database, {"event_gap", "first_event_seq", "last_event_seq"}} {}

  void remove(const OldEvent& event, std::int64_t utc_us) {
    execute(remove_, event.row);
    const bool is_first = count_++ == 0;
    from_us_ = is_first ? event.received_at_us : std::min(from_us_, event.received_at_us);
    to_us_ = is_first ? event.received_at_us : std::max(to_us_, event.received_at_us);
    if (event.boot_key != 0) gaps_.add(event.boot_key, {event.event_seq, event.event_seq + 1}, utc_us);
  }

  std::uint64_t count() const { return count_; }
  station::AuditNote note(std::int64_t utc_us) const {
    station::AuditNote note;
    note.by = {"station", "", utc_us};
    note.action = "retention.events_removed";
    note.detail = station::audit_detail({{"count", count_}, {"from_us", from_us_}, {"to_us", to_us_}});
    return note;
  }

 private:
  SQLite::Statement remove_;
  RetentionGaps gaps_;
  std::uint64_t count_ = 0;
  std::int64_t from_us_ = 0, to_us_ = 0;
};

}  // namespace

std::uint64_t EventPurge::step(SQLite::Database& database, const runtime::Clock& clock, std::int64_t utc_us) {
  const std::int64_t end_us = clock.steady_us() + kStepTime.count();
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement query{database, kOldest};
  Removal removal{database};
  for (int slices = 0; slices < kSlicesAStep && !is_done_; ++slices) {
    if (slices > 0 && clock.steady_us() >= end_us) break;
    const std::vector<OldEvent> events = oldest(query, after_row_);
    is_done_ = events.empty();
    for (const OldEvent& event : events) {
      is_done_ = !limit_.covers(event.row, event.received_at_us);
      if (is_done_) break;
      if (!event.is_held) removal.remove(event, utc_us);
      after_row_ = event.row;
    }
  }
  if (removal.count() > 0) AuditChain{database}.append(removal.note(utc_us));
  transaction.commit();
  return removal.count();
}

}  // namespace server::storage
