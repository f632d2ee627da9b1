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
  auto spans = co_await spans_of(run, after ? after->span : 0);
  if (!spans) co_return std::unexpected{spans.error()};
  for (RecordedSpan& span : *spans) span.waiting = recorder_.waiting(span.boot_id, span.samples);
  auto query = [spans = std::move(*spans), after, limit](SQLite::Database& database) {
    return read_page(database, spans, after, limit);
  };
  co_return co_await ask(std::move(query));
}

asio::awaitable<Result<std::vector<Gap>>> History::gaps(RunId run) {
  auto spans = co_await spans_of(run, 0);
  if (!spans) co_return std::unexpected{spans.error()};
  for (RecordedSpan& span : *spans) span.waiting_gaps = recorder_.waiting_gaps(span.boot_id);
  auto query = [spans = std::move(*spans)](SQLite::Database& database) { return read_gaps(database, spans); };
  co_return co_await ask(std::move(query));
}

asio::awaitable<Result<std::vector<RecordedSpan>>> History::spans_of(RunId run, std::uint32_t first_span) {
  auto query = [run, first_span](SQLite::Database& database) -> Result<std::vector<RecordedSpan>> {
    if (!run_exists(database, run)) return std::unexpected{no_such_run(run)};
    return read_spans(database, run, first_span);
  };
  co_await recorder_.flush_boots();  // a reboot heard before this moves the open span first
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
