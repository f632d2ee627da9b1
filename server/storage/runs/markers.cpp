// SQL of markers; each call is a statement or two.
#include "server/storage/runs/markers.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/runs/run_spans.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kMaxTextBytes = 4000;
constexpr std::size_t kMaxListed = 1000;

std::optional<BootSample> sample_of(SQLite::Database& database, const MarkerRequest& request, const BootHeads& heads) {
  if (request.at_us) return sample_at(database, heads, request.robot_id, *request.at_us);
  const auto boot = samples_of_boot(database, request.robot_id, request.boot_id);
  const auto head = heads.find(request.boot_id);
  if (!boot || head == heads.end() || head->second == 0) return std::nullopt;
  return BootSample{boot->boot_key, boot->boot_id, head->second - 1};
}

Result<Marker> insert(SQLite::Database& database, const MarkerRequest& request, const BootHeads& heads,
                      std::int64_t utc_us) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  const std::optional<BootSample> at = sample_of(database, request, heads);
  if (!at) {
    return fail(ErrorCode::invalid, fmt::format("robot '{}' had made no sample then", request.robot_id),
                "nothing_recorded");
  }
  SQLite::Statement add{database, "INSERT INTO marker (boot_key, seq, text, actor, made_at_us) VALUES (?, ?, ?, ?, ?)"};
  execute(add, at->boot_key, at->seq, request.text, request.actor, utc_us);
  Marker marker{database.getLastInsertRowid(), at->boot_id, at->seq, {}, {}, request.text, request.actor, utc_us};
  if (const auto time = time_of(database, at->boot_key, at->seq)) {
    marker.robot_time_us = time->robot_time_us;
    marker.utc_us = time->utc_us;
  }
  transaction.commit();
  return marker;
}

// Of rows marker_id, boot_key, boot_id, seq, text, actor, made_at_us.
std::vector<Marker> read_markers(SQLite::Database& database, SQLite::Statement& rows) {
  std::vector<Marker> markers;
  while (rows.executeStep()) {
    Marker& marker = markers.emplace_back();
    marker.id = rows.getColumn(0).getInt64();
    marker.boot_id = unsigned_id(rows.getColumn(2));
    marker.seq = unsigned_id(rows.getColumn(3));
    marker.text = rows.getColumn(4).getString();
    marker.actor = rows.getColumn(5).getString();
    marker.made_at_us = rows.getColumn(6).getInt64();
    const auto time = time_of(database, rows.getColumn(1).getInt64(), marker.seq);
    if (!time) continue;
    marker.robot_time_us = time->robot_time_us;
    marker.utc_us = time->utc_us;
  }
  return markers;
}

}  // namespace

asio::awaitable<Result<Marker>> Markers::add(MarkerRequest request) {
  if (request.text.empty() || request.text.size() > kMaxTextBytes) {
    co_return fail(ErrorCode::invalid, fmt::format("a marker's text has 1 to {} bytes", kMaxTextBytes));
  }
  if (!request.at_us && request.boot_id == 0) {
    co_return fail(ErrorCode::not_connected, fmt::format("robot '{}' is not connected; give at_us", request.robot_id));
  }
  if (request.at_us && *request.at_us > clock_.utc_us()) {
    co_return fail(ErrorCode::invalid, "at_us is in the future", "out_of_range");
  }
  const BootHeads heads{{request.boot_id, recorder_.next_seq(request.boot_id)}};
  const bool flushed = co_await recorder_.flush_records();
  if (!flushed) {
    co_return fail(ErrorCode::unavailable, "the disk cannot be written now; the station's log says why. Try again");
  }
  auto job = [request, heads, utc_us = clock_.utc_us()](Database& database) {
    return insert(database.handle(), request, heads, utc_us);
  };
  co_return co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<std::vector<Marker>> Markers::of_robot(station::RobotId robot_id, std::int64_t after,
                                                       std::size_t limit) {
  auto query = [robot_id, after, count = std::clamp<std::size_t>(limit, 1, kMaxListed)](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    SQLite::Statement rows{database,
                           "SELECT marker_id, boot_key, boot_id, seq, text, actor, made_at_us"
                           " FROM marker JOIN boot USING (boot_key)"
                           " WHERE robot_id = ? AND marker_id > ? ORDER BY marker_id LIMIT ?"};
    bind_all(rows, robot_id, after, static_cast<std::int64_t>(count));
    return read_markers(database, rows);
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<std::vector<Marker>>> Markers::of_run(RunId run) {
  auto query = [run](SQLite::Database& database) -> Result<std::vector<Marker>> {
    const SQLite::Transaction moment{database};
    if (!read_run_state(database, run)) return fail(ErrorCode::not_found, fmt::format("there is no run {}", run));
    SQLite::Statement rows{database,
                           "SELECT marker_id, boot_key, boot.boot_id, marker.seq, marker.text, marker.actor,"
                           " marker.made_at_us FROM run_marker JOIN marker USING (marker_id) JOIN boot USING (boot_key)"
                           " WHERE run_id = ? ORDER BY span, marker.seq, marker_id"};
    bind_all(rows, run);
    return read_markers(database, rows);
  };
  co_return co_await reader_.ask(std::move(query));
}

}  // namespace server::storage
