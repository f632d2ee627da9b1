// Read-only SQL: each query is one statement or a few, and ends within a page.
#include "server/storage/query/history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "server/storage/database/statement.hpp"
#include "server/storage/samples/stored_rows.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

constexpr std::size_t kMaxListed = 1000;
constexpr std::size_t kSliceSegments = 5'000;
constexpr std::size_t kSliceBoots = 100;
constexpr std::size_t kWaitingInATurn = 10'000;  // samples, in a turn of the loop

// A page of the rows of a robot, newest first, whose SQL takes: robot, time from, time to, time and row of the cursor,
// limit. One more row than the page has shows whether there are others.
template <class Record>
RecordPage<Record> read_records(SQLite::Statement& rows, const station::RobotId& robot_id, const RecordFilter& filter,
                                Record (*record_from)(SQLite::Statement&),
                                RecordCursor (*cursor_of)(SQLite::Statement&)) {
  const auto limit = std::clamp<std::size_t>(filter.limit, 1, kMaxListed);
  std::int64_t to_us = filter.window.to_us;
  std::optional<std::int64_t> at_us, row;
  if (filter.before) {
    at_us = filter.before->at_us;
    row = filter.before->row;
    to_us = std::min(to_us, *at_us + 1);
  }
  bind_all(rows, robot_id, filter.window.from_us, to_us, at_us, row, static_cast<std::int64_t>(limit) + 1);
  RecordPage<Record> page;
  while (rows.executeStep()) {
    if (page.records.size() == limit) return page;
    page.records.push_back(record_from(rows));
    page.next = cursor_of(rows);
  }
  page.next.reset();
  return page;
}

RecordCursor event_cursor(SQLite::Statement& row) {
  return {row.getColumn(kEventReceivedAt).getInt64(), row.getColumn(kEventRow).getInt64()};
}

RecordCursor command_cursor(SQLite::Statement& row) {
  return {row.getColumn(kCommandSubmittedAt).getInt64(), row.getColumn(kCommandId).getInt64()};
}

const char* renewals_condition(RenewalRows renewals) {
  switch (renewals) {
    case RenewalRows::none: return " AND kind <> 'renew_lease'";
    case RenewalRows::counted: return " AND (kind <> 'renew_lease' OR further_renewals IS NOT 0)";
    default: return "";
  }
}

// As the database has them, without what waits.
Result<std::vector<RecordedSpan>> read_excerpt(SQLite::Database& database, const Excerpt& excerpt,
                                               std::uint32_t first_span) {
  if (excerpt.run) {
    if (run_exists(database, *excerpt.run)) return read_spans(database, *excerpt.run, first_span);
    return fail(ErrorCode::not_found, fmt::format("there is no run {}", *excerpt.run));
  }
  if (!robot_exists(database, excerpt.robot_id)) {
    return fail(ErrorCode::not_found, fmt::format("there is no robot {}", excerpt.robot_id));
  }
  auto boots = read_boots(database, excerpt.robot_id);
  std::erase_if(boots, [first_span](const RecordedSpan& span) { return span.span < first_span; });
  return boots;
}

}  // namespace

History::History(std::filesystem::path database, Recorder& recorder, runtime::WorkerThread& readers)
    : recorder_{recorder}, reader_{std::move(database), readers} {}

asio::awaitable<bool> History::settle() { co_return co_await recorder_.flush_records(); }

asio::awaitable<Result<void>> History::store_waiting(std::vector<RecordedSpan> spans) {
  bool is_stored = co_await recorder_.flush_records();
  for (const RecordedSpan& span : spans) {
    if (span.waiting.empty() && span.waiting_gaps.empty()) continue;
    const bool has_samples = co_await recorder_.flush(span.boot_id);
    is_stored = is_stored && has_samples;
  }
  if (is_stored) co_return Result<void>{};
  co_return fail(ErrorCode::unavailable,
                 "the station's disk has not taken what was recorded last; ask again when it takes it", "not_durable");
}

asio::awaitable<Result<std::vector<RecordedSpan>>> History::spans(Excerpt excerpt, std::optional<SampleCursor> after,
                                                                  std::size_t limit) {
  if (excerpt.window) limit = Recorder::kAll;
  auto query = [excerpt, first_span = after ? after->span : 0](SQLite::Database& database) {
    return read_excerpt(database, excerpt, first_span);
  };
  co_await recorder_.flush_boots();  // a reboot received before this moves the open span first
  auto found = co_await reader_.ask(std::move(query));
  if (!found) co_return found;
  for (RecordedSpan& span : *found) {
    Interval samples = span.samples;
    const bool resumed = after && after->span == span.span && !excerpt.window;
    if (resumed) samples.first = std::max(samples.first, after->seq + 1);
    co_await add_waiting(span, samples, limit);
  }
  if (!excerpt.window) co_return found;
  co_return co_await in_window(std::move(*found), *excerpt.window);
}

// In slices, since a robot may have thousands of boots.
asio::awaitable<std::vector<RecordedSpan>> History::in_window(std::vector<RecordedSpan> spans, TimeWindow window) {
  std::vector<RecordedSpan> found;
  for (std::size_t begin = 0; begin < spans.size(); begin += kSliceBoots) {
    const std::span slice{spans.data() + begin, std::min(kSliceBoots, spans.size() - begin)};
    auto cut = [slice, window](SQLite::Database& database) { return cut_to_window(database, slice, window); };
    std::vector<RecordedSpan> some = co_await reader_.ask(std::move(cut));
    std::ranges::move(some, std::back_inserter(found));
  }
  co_return found;
}

// In turns of the loop, since hours may wait. What is stored between two of them is in the database before it is asked.
asio::awaitable<void> History::add_waiting(RecordedSpan& span, Interval samples, std::size_t& limit) const {
  span.made_next = std::max(span.made_next, std::min(span.samples.next, recorder_.next_seq(span.boot_id)));
  while (limit > 0) {
    std::vector<Segment> some = recorder_.waiting(span.boot_id, samples, std::min(limit, kWaitingInATurn));
    if (some.empty()) break;
    samples.first = some.back().next_seq();
    std::size_t copied = 0;
    for (const Segment& segment : some) copied += segment.samples.size();
    std::ranges::move(some, std::back_inserter(span.waiting));
    limit -= std::min(limit, copied);
    if (copied < kWaitingInATurn) break;  // that was all, or enough
    co_await asio::post(recorder_.loop(), asio::use_awaitable);
  }
  span.waiting_gaps = recorder_.waiting_gaps(span.boot_id, span.samples);
}

asio::awaitable<Result<SegmentPage>> History::segments(Excerpt excerpt, std::optional<SampleCursor> after,
                                                       std::size_t limit, Channels channels) {
  if (limit < 1 || limit > kMaxPageSamples) {
    co_return fail(ErrorCode::invalid, fmt::format("limit is {}, allowed are 1 to {}", limit, kMaxPageSamples));
  }
  auto found = co_await spans(excerpt, after, limit + 1);  // one more shows whether this is the end
  if (!found) co_return std::unexpected{found.error()};
  auto query = [spans = std::move(*found), after, limit, channels](SQLite::Database& database) {
    return read_segments(database, spans, after, limit, channels);
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<SamplePage>> History::samples(RunId run, std::optional<SampleCursor> after, std::size_t limit) {
  auto page = co_await segments(excerpt_of(run), after, limit);
  if (!page) co_return std::unexpected{page.error()};
  auto job = [page = std::move(*page)] { return samples_of(page); };
  co_return co_await reader_.run(std::move(job));
}

asio::awaitable<Result<AbsencePage>> History::gaps(Excerpt excerpt, std::optional<SampleCursor> after,
                                                   std::size_t limit) {
  if (limit < 1 || limit > kMaxPageGaps) {
    co_return fail(ErrorCode::invalid, fmt::format("limit is {}, allowed are 1 to {}", limit, kMaxPageGaps));
  }
  auto found = co_await spans(std::move(excerpt), after);
  if (!found) co_return std::unexpected{found.error()};
  const auto& spans = *found;
  auto query = [&spans, after, limit](SQLite::Database& database) { return read_gaps(database, spans, after, limit); };
  GapPage gaps = co_await reader_.ask(std::move(query));
  AbsencePage page{std::move(gaps.gaps), {}, gaps.next};
  for (const RecordedSpan& span : spans) {
    if (page.next && span.span > page.next->span) break;
    co_await add_missing(span, after, limit, page);
  }
  co_return page;
}

// What is missing of the span on this page. Where that is more than a page holds, the page ends there.
asio::awaitable<void> History::add_missing(const RecordedSpan& span, const std::optional<SampleCursor>& after,
                                           std::size_t limit, AbsencePage& page) {
  Interval left{std::max(span.samples.first, span.settled_next), span.made().next};
  if (after && after->span == span.span) left.first = std::max(left.first, after->seq + 1);
  if (page.next && page.next->span == span.span) left.next = std::min(left.next, page.next->seq + 1);
  while (left.first < left.next) {
    auto slice = [&span, &left](SQLite::Database& database) {
      return read_missing(database, span, left, kSliceSegments);
    };
    const auto missing = co_await reader_.ask(std::move(slice));
    page.missing.insert(page.missing.end(), missing.begin(), missing.end());
    if (page.missing.size() <= limit) continue;
    page.missing.resize(limit);
    page.next = SampleCursor{page.missing.back().span, page.missing.back().last_seq};
    std::erase_if(page.gaps, [&next = *page.next](const Gap& gap) {
      return gap.span > next.span || (gap.span == next.span && gap.first_seq > next.seq);
    });
    co_return;
  }
}

asio::awaitable<Result<Overview>> History::overview(Excerpt excerpt, OverviewQuery query) {
  auto found = co_await spans(std::move(excerpt));
  if (!found) co_return std::unexpected{found.error()};
  const auto& spans = *found;
  Overview overview;
  auto gaps = [&spans](SQLite::Database& database) { return read_gaps(database, spans, {}, kMaxPageGaps); };
  overview.gaps = co_await reader_.ask(std::move(gaps));
  OverviewScan scan{spans, query};
  bool more = true;
  while (more) {
    auto slice = [&scan](SQLite::Database& database) { return scan.advance(database); };
    more = co_await reader_.ask(std::move(slice));
  }
  overview.columns = scan.take();
  co_return overview;
}

asio::awaitable<RecordPage<station::RobotEvent>> History::events(station::RobotId robot_id, RecordFilter filter) {
  auto query = [robot_id, filter](SQLite::Database& database) {
    SQLite::Statement rows{database,
                           select_events("WHERE event.robot_id = ?1 AND received_at_us >= ?2 AND received_at_us < ?3"
                                         " AND (?4 IS NULL OR (received_at_us, event_row) < (?4, ?5))"
                                         " ORDER BY received_at_us DESC, event_row DESC LIMIT ?6")};
    return read_records(rows, robot_id, filter, event_from, event_cursor);
  };
  co_await recorder_.flush_records();
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<RecordPage<station::CommandRecord>> History::commands(station::RobotId robot_id, RecordFilter filter) {
  auto query = [robot_id, filter](SQLite::Database& database) {
    const std::string condition = fmt::format(
        "WHERE robot_id = ?1 AND submitted_at_us >= ?2 AND submitted_at_us < ?3"
        " AND (?4 IS NULL OR (submitted_at_us, command_id) < (?4, ?5)){}"
        " ORDER BY submitted_at_us DESC, command_id DESC LIMIT ?6",
        renewals_condition(filter.renewals));
    SQLite::Statement rows{database, select_commands(condition.c_str())};
    return read_records(rows, robot_id, filter, command_from, command_cursor);
  };
  co_await recorder_.flush_records();
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<AuditPage> History::audit(AuditFilter filter) {
  auto query = [filter](SQLite::Database& database) { return read_audit(database, filter); };
  co_await recorder_.flush_records();
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<station::CommandRecord>> History::command(station::CommandId id) {
  co_await recorder_.flush_records();
  co_return co_await stored_command(id);
}

asio::awaitable<Result<station::CommandRecord>> History::stored_command(station::CommandId id) {
  auto query = [id](SQLite::Database& database) -> Result<station::CommandRecord> {
    SQLite::Statement row{database, select_commands("WHERE command_id = ?")};
    bind_all(row, id);
    if (!row.executeStep()) return fail(ErrorCode::not_found, fmt::format("there is no command {}", id));
    return command_from(row);
  };
  co_return co_await reader_.ask(std::move(query));
}

}  // namespace server::storage
