// What is to be given up is found on a reader; the recorder gives it up.
#include "server/storage/finalizing/run_finalizer.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/runs/run_store.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kLookInterval = 30s;
// Robots that were away because the station was off, or could not write, have come back by then. It was, too, when
// nobody has looked for so long: the machine was suspended.
constexpr microseconds kTimeToComeBack = 1h;
constexpr microseconds kStandstill = 5min;
constexpr microseconds kDisconnectPatience = 3s;
constexpr microseconds kDisconnectLook = 20ms;
constexpr std::int64_t kDayUs = 86'400'000'000;
constexpr Interval kAllSamples{0, std::numeric_limits<std::uint64_t>::max()};

constexpr const char* kWithoutDigest =
    "state IN ('ended', 'interrupted') AND NOT EXISTS (SELECT 1 FROM run_certificate WHERE run_id = run.run_id)";

station::AuditNote note_of(const char* action, const station::RobotId& robot_id, std::string subject,
                           const nlohmann::json& detail, station::Author by) {
  station::AuditNote note;
  note.by = std::move(by);
  note.robot_id = robot_id;
  note.action = action;
  note.subject = std::move(subject);
  note.detail = station::audit_detail(detail);
  return note;
}

// What a run expects of each boot.
Result<GiveUpOrder> order_for(SQLite::Database& database, RunId run) {
  const SQLite::Transaction moment{database};
  const std::optional<RunState> state = read_run_state(database, run);
  if (!state) return fail(ErrorCode::not_found, fmt::format("there is no run {}", run));
  if (*state == RunState::open)
    return fail(ErrorCode::conflict, fmt::format("run {} is open; end it first", run), "run_is_open");
  if (*state == RunState::discarded)
    return fail(ErrorCode::conflict, fmt::format("run {} was discarded", run), "discarded");
  GiveUpOrder order;
  order.robot_id = robot_of(database, run);
  for (const DigestSpan& span : read_digest_spans(database, run)) order.parts.push_back({span.boot_id, span.samples});
  return order;
}

// Boots of the robot that have not ended.
std::vector<GiveUpOrder::Part> boots_of(SQLite::Database& database, const station::RobotId& robot_id) {
  std::vector<GiveUpOrder::Part> boots;
  SQLite::Statement rows{database, "SELECT boot_id FROM boot WHERE robot_id = ? AND ended_next_seq IS NULL"};
  bind_all(rows, robot_id);
  while (rows.executeStep()) boots.push_back({unsigned_id(rows.getColumn(0)), kAllSamples});
  return boots;
}

// Revoked robots of which the database misses samples.
std::vector<station::RobotId> revoked_robots(SQLite::Database& database) {
  std::vector<station::RobotId> robots;
  SQLite::Statement rows{
      database,
      "SELECT DISTINCT robot_id FROM robot JOIN boot USING (robot_id)"
      " WHERE revoked_at_us IS NOT NULL AND ended_next_seq IS NULL AND durable_next_seq < max(announced_next_seq,"
      " coalesce((SELECT last_seq + 1 FROM segment WHERE segment.boot_key = boot.boot_key"
      " ORDER BY first_seq DESC LIMIT 1), 0),"
      " coalesce((SELECT last_seq + 1 FROM gap WHERE gap.boot_key = boot.boot_key ORDER BY first_seq DESC LIMIT 1), "
      "0))"};
  while (rows.executeStep()) robots.push_back(rows.getColumn(0).getString());
  return robots;
}

std::vector<RunId> waiting_runs(SQLite::Database& database, const station::RobotId& robot_id) {
  std::vector<RunId> runs;
  SQLite::Statement rows{database, fmt::format("SELECT run_id FROM run WHERE robot_id = ? AND {}", kWithoutDigest)};
  bind_all(rows, robot_id);
  while (rows.executeStep()) runs.push_back(rows.getColumn(0).getInt64());
  return runs;
}

// Those that ended before this time, and whose robot has not connected since.
std::vector<RunId> old_runs(SQLite::Database& database, std::int64_t before_us) {
  std::vector<RunId> runs;
  SQLite::Statement rows{database, fmt::format("SELECT run_id FROM run WHERE ended_at_us < ?1 AND {}"
                                               " AND NOT EXISTS (SELECT 1 FROM boot WHERE boot.robot_id = run.robot_id"
                                               " AND connected_at_us >= ?1)",
                                               kWithoutDigest)};
  bind_all(rows, before_us);
  while (rows.executeStep()) runs.push_back(rows.getColumn(0).getInt64());
  return runs;
}

}  // namespace

RunFinalizer::RunFinalizer(runtime::Clock& clock, const RemovalClock& removal_clock, Recorder& recorder,
                           DatabaseReader& reader, RunDigester& digester, std::uint32_t after_days)
    : clock_{clock},
      recorder_{recorder},
      reader_{reader},
      digester_{digester},
      removal_clock_{removal_clock},
      after_days_{after_days},
      begun_us_{clock.steady_us()} {}

asio::awaitable<void> RunFinalizer::run() {
  for (;;) {
    co_await clock_.sleep_for(kLookInterval);
    try {
      co_await pass();
    } catch (const SQLite::Exception& error) {  // an unreadable page is no reason to end the emergency stop
      spdlog::error("runs that are to become final cannot be found: {}; looked at again in 30 s",
                    runtime::text_of(error));
    }
  }
}

asio::awaitable<void> RunFinalizer::pass() {
  const bool is_stored = co_await recorder_.flush_boots();  // who has connected until now
  if (!is_stored) co_return;
  const std::int64_t now_us = clock_.steady_us();
  if (now_us - looked_at_us_ > kStandstill.count()) begun_us_ = now_us;
  looked_at_us_ = now_us;
  const std::vector<station::RobotId> revoked = co_await reader_.ask(revoked_robots);
  const station::Author station{"station", "", 0};
  for (const station::RobotId& robot_id : revoked) co_await give_up_revoked(robot_id, station);
  if (after_days_ > 0 && now_us - begun_us_ >= kTimeToComeBack.count()) co_await finalize_old_runs();
}

asio::awaitable<void> RunFinalizer::finalize_old_runs() {
  auto query = [before_us = old_before_us()](SQLite::Database& database) { return old_runs(database, before_us); };
  const std::vector<RunId> runs = co_await reader_.ask(std::move(query));
  for (const RunId run : runs) {
    auto find = [run](SQLite::Database& database) { return order_for(database, run); };
    Result<GiveUpOrder> order = co_await reader_.ask(std::move(find));
    if (!order) continue;  // discarded meanwhile
    const nlohmann::json detail{{"reason", "time"}, {"after_days", after_days_}};
    order->note = note_of("run.finalized", order->robot_id, std::to_string(run), detail, {"station", "", 0});
    co_await give_up(std::move(*order));  // one that is refused is looked at again
  }
}

// Nothing grows old by a clock that is set forward.
std::int64_t RunFinalizer::old_before_us() const { return removal_clock_.utc_us() - after_days_ * kDayUs; }

asio::awaitable<Result<std::uint64_t>> RunFinalizer::finalize(RunId run, std::uint64_t samples, station::Author by) {
  auto query = [run](SQLite::Database& database) { return order_for(database, run); };
  Result<GiveUpOrder> order = co_await reader_.ask(std::move(query));
  if (!order) co_return std::unexpected{order.error()};
  order->samples = samples;
  order->note = note_of("run.finalized", order->robot_id, std::to_string(run), {{"reason", "asked"}}, std::move(by));
  co_return co_await give_up(std::move(*order));
}

asio::awaitable<Result<std::uint64_t>> RunFinalizer::give_up_revoked(station::RobotId robot_id, station::Author by) {
  const bool is_stored = co_await recorder_.flush_boots();
  if (!is_stored) co_return fail(ErrorCode::unavailable, "nothing was given up: the disk cannot be written now");
  auto query = [robot_id](SQLite::Database& database) { return boots_of(database, robot_id); };
  const std::int64_t deadline_us = clock_.steady_us() + kDisconnectPatience.count();
  for (;;) {
    GiveUpOrder order;
    order.robot_id = robot_id;
    order.parts = co_await reader_.ask(query);
    order.note = note_of("robot.samples_given_up", robot_id, robot_id, {{"reason", "revoked"}}, by);
    Result<std::uint64_t> outcome = co_await give_up(std::move(order));
    const bool is_connected = !outcome && outcome.error().reason == "robot_connected";
    if (!is_connected || clock_.steady_us() >= deadline_us) co_return outcome;
    co_await clock_.sleep_for(kDisconnectLook);
  }
}

asio::awaitable<Result<std::uint64_t>> RunFinalizer::give_up(GiveUpOrder order) {
  order.note.by.at_us = clock_.utc_us();
  const station::RobotId robot_id = order.robot_id;
  const Result<std::uint64_t> outcome = co_await recorder_.give_up(std::move(order));
  if (!outcome) co_return outcome;
  auto query = [robot_id](SQLite::Database& database) { return waiting_runs(database, robot_id); };
  const std::vector<RunId> runs = co_await reader_.ask(std::move(query));
  for (const RunId run : runs) digester_.add(run);
  co_return outcome;
}

}  // namespace server::storage
