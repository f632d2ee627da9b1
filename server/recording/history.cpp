// Read-only SQL: each query is one statement or a few, and ends within a page.
#include "server/recording/history.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "server/recording/recorder.hpp"
#include "server/recording/statement.hpp"
#include "server/recording/stored_rows.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kMaxPageSamples = 10'000;
constexpr std::size_t kMaxListed = 1000;

struct Span {
  std::uint32_t span = 0;
  std::int64_t boot_key = 0;
  BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;  // the largest number there is while the span is open
};

// Segments by index, then their rows by number: in order of seq without sorting. ?2 first and ?3 last seq.
constexpr const char* kSampleQuery =
    "SELECT segment.first_seq + sample.row - segment.first_row,"
    " segment.first_robot_time_us + (sample.row - segment.first_row) * segment.period_us,"
    " segment.utc_offset_us, segment.received_at_us, sample.position_m, sample.velocity_m_s, sample.acceleration_m_s2,"
    " sample.duty, sample.impedance_mv, sample.reference_m, segment.mode, segment.sub_state, segment.setpoint_m,"
    " segment.disturbance_m"
    " FROM segment CROSS JOIN sample"
    " WHERE segment.boot_key = ?1 AND segment.first_seq >= ?2 - 99 AND segment.first_seq <= ?3"
    " AND sample.row >= segment.first_row + max(0, ?2 - segment.first_seq)"
    " AND sample.row <= segment.last_row - max(0, segment.last_seq - ?3)"
    " ORDER BY segment.first_seq, sample.row LIMIT ?4";

StoredSample sample_from(SQLite::Statement& row, const Span& span) {
  StoredSample stored;
  stored.span = span.span;
  stored.boot_id = span.boot_id;
  stored.seq = unsigned_id(row.getColumn(0));
  stored.robot_time_us = unsigned_id(row.getColumn(1));
  stored.utc_us = row.getColumn(1).getInt64() + row.getColumn(2).getInt64();
  stored.received_at_us = row.getColumn(3).getInt64();
  stored.sample.position_m = float_or_nan(row.getColumn(4));
  stored.sample.velocity_m_s = float_or_nan(row.getColumn(5));
  stored.sample.acceleration_m_s2 = float_or_nan(row.getColumn(6));
  stored.sample.duty = float_or_nan(row.getColumn(7));
  stored.sample.impedance_mv = float_or_nan(row.getColumn(8));
  stored.sample.reference_m = float_or_nan(row.getColumn(9));
  stored.mode = mode_from(row.getColumn(10).getString());
  stored.sub_state = sub_state_from(row.getColumn(11).getString());
  stored.setpoint_m = optional_float(row.getColumn(12));
  stored.disturbance_m = float_or_nan(row.getColumn(13));
  return stored;
}

bool run_exists(SQLite::Database& database, RunId run) {
  SQLite::Statement query{database, "SELECT 1 FROM run WHERE run_id = ?"};
  bind_all(query, run);
  return query.executeStep();
}

std::vector<Span> read_spans(SQLite::Database& database, RunId run, std::uint32_t first_span) {
  std::vector<Span> spans;
  SQLite::Statement query{database,
                          "SELECT span, boot_key, boot_id, first_seq, coalesce(last_seq, 9223372036854775807)"
                          " FROM run_span JOIN boot USING (boot_key) WHERE run_id = ? AND span >= ? ORDER BY span"};
  bind_all(query, run, first_span);
  while (query.executeStep()) {
    spans.push_back({query.getColumn(0).getUInt(), query.getColumn(1).getInt64(), unsigned_id(query.getColumn(2)),
                     unsigned_id(query.getColumn(3)), unsigned_id(query.getColumn(4))});
  }
  return spans;
}

SamplePage read_page(SQLite::Database& database, const std::vector<Span>& spans,
                     const std::optional<SampleCursor>& after, std::size_t limit) {
  SamplePage page;
  SQLite::Statement query{database, kSampleQuery};
  for (const Span& span : spans) {
    const bool resumed = after && after->span == span.span;
    const std::uint64_t first_seq = resumed ? std::max(span.first_seq, after->seq + 1) : span.first_seq;
    const std::size_t wanted = limit + 1 - page.samples.size();  // one more tells whether this is the end
    bind_all(query, span.boot_key, first_seq, span.last_seq, static_cast<std::int64_t>(wanted));
    while (query.executeStep()) page.samples.push_back(sample_from(query, span));
    if (page.samples.size() > limit) break;
  }
  if (page.samples.size() > limit) {
    page.samples.pop_back();
    page.next = SampleCursor{page.samples.back().span, page.samples.back().seq};
  }
  return page;
}

std::vector<Gap> read_gaps(SQLite::Database& database, const std::vector<Span>& spans) {
  std::vector<Gap> gaps;
  SQLite::Statement query{database,
                          "SELECT max(first_seq, ?2), min(last_seq, ?3), cause, noticed_at_us FROM gap"
                          " WHERE boot_key = ?1 AND first_seq <= ?3 AND last_seq >= ?2 ORDER BY first_seq"};
  for (const Span& span : spans) {
    bind_all(query, span.boot_key, span.first_seq, span.last_seq);
    while (query.executeStep()) {
      gaps.push_back({span.boot_id, unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)),
                      query.getColumn(2).getString(), query.getColumn(3).getInt64()});
    }
  }
  return gaps;
}

Error no_such_run(RunId run) { return {ErrorCode::not_found, fmt::format("there is no run {}", run), ""}; }

std::int64_t clamped(std::size_t limit) {
  return static_cast<std::int64_t>(std::clamp<std::size_t>(limit, 1, kMaxListed));
}

}  // namespace

History::History(std::filesystem::path database, Recorder& recorder, WorkerThread& readers)
    : path_{std::move(database)}, recorder_{recorder}, readers_{readers} {}

History::~History() = default;

asio::awaitable<void> History::settle() { co_await recorder_.flush_records(); }

template <class Query>
asio::awaitable<std::invoke_result_t<Query, SQLite::Database&>> History::ask(Query query) {
  auto job = [this, query = std::move(query)]() mutable {
    if (!database_) database_ = std::make_unique<SQLite::Database>(open_for_reading(path_));
    return query(*database_);
  };
  co_return co_await readers_.run(std::move(job));
}

asio::awaitable<Result<SamplePage>> History::samples(RunId run, std::optional<SampleCursor> after, std::size_t limit) {
  if (limit < 1 || limit > kMaxPageSamples) {
    co_return fail(ErrorCode::invalid, fmt::format("limit is {}, allowed are 1 to {}", limit, kMaxPageSamples));
  }
  auto query = [run, after, limit](SQLite::Database& database) -> Result<SamplePage> {
    if (!run_exists(database, run)) return std::unexpected{no_such_run(run)};
    return read_page(database, read_spans(database, run, after ? after->span : 0), after, limit);
  };
  // The first page has everything heard so far stored, so only a page at the end must ask again for what came since.
  if (after) {
    auto full = co_await ask(query);
    const bool is_full = full && full->samples.size() == limit;
    if (is_full) co_return full;
  }
  co_await recorder_.flush();
  co_return co_await ask(std::move(query));
}

asio::awaitable<Result<std::vector<Gap>>> History::gaps(RunId run) {
  auto query = [run](SQLite::Database& database) -> Result<std::vector<Gap>> {
    if (!run_exists(database, run)) return std::unexpected{no_such_run(run)};
    return read_gaps(database, read_spans(database, run, 0));
  };
  co_await recorder_.flush();
  co_return co_await ask(std::move(query));
}

asio::awaitable<std::vector<RobotEvent>> History::events(RobotId robot_id, std::size_t limit) {
  auto query = [robot_id, limit](SQLite::Database& database) {
    std::vector<RobotEvent> events;
    SQLite::Statement rows{database, select_events("WHERE event.robot_id = ? ORDER BY event_row DESC LIMIT ?")};
    bind_all(rows, robot_id, clamped(limit));
    while (rows.executeStep()) events.push_back(event_from(rows));
    return events;
  };
  co_await recorder_.flush_records();
  co_return co_await ask(std::move(query));
}

asio::awaitable<std::vector<CommandRecord>> History::commands(RobotId robot_id, std::size_t limit) {
  auto query = [robot_id, limit](SQLite::Database& database) {
    std::vector<CommandRecord> commands;
    SQLite::Statement rows{database, select_commands("WHERE robot_id = ? ORDER BY submitted_at_us DESC LIMIT ?")};
    bind_all(rows, robot_id, clamped(limit));
    while (rows.executeStep()) commands.push_back(command_from(rows));
    return commands;
  };
  co_await recorder_.flush_records();
  co_return co_await ask(std::move(query));
}

asio::awaitable<Result<CommandRecord>> History::command(CommandId id) {
  auto query = [id](SQLite::Database& database) -> Result<CommandRecord> {
    SQLite::Statement row{database, select_commands("WHERE command_id = ?")};
    bind_all(row, id);
    if (!row.executeStep()) return fail(ErrorCode::not_found, fmt::format("there is no command {}", id));
    return command_from(row);
  };
  co_await recorder_.flush_records();
  co_return co_await ask(std::move(query));
}

}  // namespace server
