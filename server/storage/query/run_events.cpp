// Spans of the run joined with events by boot and sample.
#include "server/storage/query/run_events.hpp"

#include <fmt/format.h>

#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_spans.hpp"
#include "server/storage/samples/stored_rows.hpp"

namespace server::storage {

bool is_event_kind(const std::string& kind) {
  return enumerator_from<protocol::EventKind>(kind) != 0 && kind != protocol::text(protocol::EventKind{}) &&
         kind != "unknown";
}

std::vector<RunMoment> read_run_events(SQLite::Database& database, RunId run, const std::vector<std::string>& kinds) {
  std::string wanted;
  for (std::size_t i = 0; i < kinds.size(); ++i) wanted += i == 0 ? "?" : ",?";
  SQLite::Statement rows{
      database, fmt::format("SELECT span, sample_seq, robot_time_us, kind, position_m, value FROM run_span"
                            " CROSS JOIN event USING (boot_key) WHERE run_id = ? AND event_seq IS NOT NULL"
                            " AND sample_seq >= first_seq AND sample_seq <= coalesce(last_seq, 9223372036854775807)"
                            " AND kind IN ({}) ORDER BY span, event_seq LIMIT {}",
                            wanted, kMaxRunMoments)};
  rows.bind(1, run);
  for (std::size_t i = 0; i < kinds.size(); ++i) rows.bind(static_cast<int>(i) + 2, kinds[i]);
  std::vector<RunMoment> moments;
  while (rows.executeStep()) {
    moments.push_back({rows.getColumn(0).getUInt(), unsigned_id(rows.getColumn(1)), unsigned_id(rows.getColumn(2)),
                       rows.getColumn(3).getString(), float_or_nan(rows.getColumn(4)),
                       float_or_nan(rows.getColumn(5))});
  }
  return moments;
}

std::vector<RunMoment> read_run_markers(SQLite::Database& database, RunId run) {
  SQLite::Statement rows{database, fmt::format("SELECT span, boot_key, run_marker.seq, marker.text FROM run_marker"
                                               " JOIN marker USING (marker_id) WHERE run_id = ?"
                                               " ORDER BY span, run_marker.seq, marker_id LIMIT {}",
                                               kMaxRunMoments)};
  rows.bind(1, run);
  std::vector<RunMoment> moments;
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  while (rows.executeStep()) {
    const std::uint64_t seq = unsigned_id(rows.getColumn(2));
    const auto time = time_of(database, rows.getColumn(1).getInt64(), seq);
    if (!time) continue;
    moments.push_back(
        {rows.getColumn(0).getUInt(), seq, time->robot_time_us, rows.getColumn(3).getString(), nothing, nothing});
  }
  return moments;
}

}  // namespace server::storage
