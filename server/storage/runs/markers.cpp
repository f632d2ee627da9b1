// SQL of markers; each call is a statement or two.
#include "server/storage/runs/markers.hpp"

#include <fmt/format.h>

#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/runs/run_spans.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kMaxTextBytes = 4000;

// With which sample the open run of the boot begins.
std::optional<std::uint64_t> begin_of_open_run(SQLite::Database& database, std::int64_t boot_key) {
  SQLite::Statement open{database, "SELECT max(first_seq) FROM run_span WHERE boot_key = ? AND last_seq IS NULL"};
  bind_all(open, boot_key);
  if (!open.executeStep() || open.getColumn(0).isNull()) return std::nullopt;
  return unsigned_id(open.getColumn(0));
}

std::optional<BootSample> sample_of(SQLite::Database& database, const MarkerRequest& request, const BootHeads& heads) {
  if (request.at_us) return sample_at(database, heads, request.robot_id, *request.at_us);
  const auto boot = samples_of_boot(database, request.robot_id, request.boot_id);
  const auto head = heads.find(request.boot_id);
  if (!boot || head == heads.end()) return std::nullopt;
  const std::uint64_t next = head->second;
  if (begin_of_open_run(database, boot->boot_key) == next) return BootSample{boot->boot_key, boot->boot_id, next};
  if (next == 0) return std::nullopt;
  return BootSample{boot->boot_key, boot->boot_id, next - 1};
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

// Of a row marker_id, boot_key, boot_id, seq, text, actor, made_at_us.
Marker marker_from(SQLite::Database& database, SQLite::Statement& row) {
  Marker marker;
  marker.id = row.getColumn(0).getInt64();
  marker.boot_id = unsigned_id(row.getColumn(2));
  marker.seq = unsigned_id(row.getColumn(3));
  marker.text = row.getColumn(4).getString();
  marker.actor = row.getColumn(5).getString();
  marker.made_at_us = row.getColumn(6).getInt64();
  if (const auto time = time_of(database, row.getColumn(1).getInt64(), marker.seq)) {
    marker.robot_time_us = time->robot_time_us;
    marker.utc_us = time->utc_us;
  }
  return marker;
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
  auto query = [robot_id, after, limit](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    SQLite::Statement rows{database,
                           "SELECT marker_id, boot_key, boot_id, seq, text, actor, made_at_us"
                           " FROM marker JOIN boot USING (boot_key)"
                           " WHERE robot_id = ? AND marker_id > ? ORDER BY marker_id LIMIT ?"};
    bind_all(rows, robot_id, after, static_cast<std::int64_t>(limit));
    std::vector<Marker> markers;
    while (rows.executeStep()) markers.push_back(marker_from(database, rows));
    return markers;
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<MarkerPage>> Markers::of_run(RunId run, std::optional<MarkerCursor> after, std::size_t limit) {
  auto query = [run, after, limit](SQLite::Database& database) -> Result<MarkerPage> {
    const SQLite::Transaction moment{database};
    if (!read_run_state(database, run)) return fail(ErrorCode::not_found, fmt::format("there is no run {}", run));
    SQLite::Statement rows{database,
                           "SELECT marker_id, boot_key, boot.boot_id, marker.seq, marker.text, marker.actor,"
                           " marker.made_at_us, span"
                           " FROM run_marker JOIN marker USING (marker_id) JOIN boot USING (boot_key)"
                           " WHERE run_id = ?1 AND (?2 IS NULL OR (span, marker.seq, marker_id) > (?2, ?3, ?4))"
                           " ORDER BY span, marker.seq, marker_id LIMIT ?5"};
    const MarkerCursor from = after.value_or(MarkerCursor{});
    bind_all(rows, run, after ? std::optional<std::int64_t>{from.span} : std::nullopt, from.seq, from.id,
             static_cast<std::int64_t>(limit) + 1);
    MarkerPage page;
    while (rows.executeStep()) {
      if (page.markers.size() == limit) return page;
      const Marker& marker = page.markers.emplace_back(marker_from(database, rows));
      page.next = {rows.getColumn(7).getUInt(), marker.seq, marker.id};
    }
    page.next.reset();
    return page;
  };
  co_return co_await reader_.ask(std::move(query));
}

}  // namespace server::storage
