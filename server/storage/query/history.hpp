// Queries of recorded data: samples, overviews and gaps of an excerpt; events, commands.
//
// Loop thread; the queries run on a worker with a read-only connection, in slices of at most 20 ms, so no read
// transaction lives long, nobody waits behind a long question, and a coroutine that is cancelled asks no further.
// An answer holds everything up to its question. Samples and gaps that are not stored yet are joined from the
// recorder's memory, so that a page which polls neither writes nor cuts a segment short. Queries of events and commands
// let the recorder commit those first; while the disk fails they answer after 3 s, with what is stored.
// Needs a running Recorder, which has opened the database; recorder and worker outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/storage/audit/audit_queries.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/query/overview.hpp"
#include "server/storage/query/span_finder.hpp"
#include "server/storage/query/span_reader.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

// A run or all that a robot recorded; or what of it lies in a window of time.
struct Excerpt {
  std::optional<RunId> run;
  station::RobotId robot_id;  // when there is no run
  std::optional<TimeWindow> window;
};

inline Excerpt excerpt_of(RunId run) { return {.run = run, .robot_id = {}, .window = {}}; }

// What is not there, in order of span and seq.
struct AbsencePage {
  std::vector<Gap> gaps;
  std::vector<MissingRange> missing;
  std::optional<SampleCursor> next;  // the last sample of the page; empty: the end
};

struct Overview {
  OverviewColumns columns;
  GapPage gaps;  // the first
};

inline constexpr std::size_t kMaxPageSamples = 10'000;
inline constexpr std::size_t kMaxPageGaps = 10'000;

// The place of an event or a command in its list: the time that orders it, and its row among those of that time.
struct RecordCursor {
  std::int64_t at_us = 0;
  std::int64_t row = 0;
};

// Which commands of kind renew_lease.
enum class RenewalRows : std::uint8_t {
  all,
  none,
  counted,  // those that others followed, which have no row of their own, or may have followed
};

// Of the events or the commands of a robot.
struct RecordFilter {
  std::size_t limit = 100;  // 1 to 1000
  TimeWindow window{std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()};
  std::optional<RecordCursor> before{};
  RenewalRows renewals = RenewalRows::all;
};

template <class Record>
struct RecordPage {
  std::vector<Record> records;
  std::optional<RecordCursor> next;  // of the last one of the page; empty: the end
};

class History {
 public:
  History(std::filesystem::path database, Recorder& recorder, runtime::WorkerThread& readers);

  // not_found: there is no such run or robot, in all of these.
  // At most `limit` samples (1 to 10000), in order of span and seq, after the cursor.
  boost::asio::awaitable<Result<SegmentPage>> segments(Excerpt excerpt, std::optional<SampleCursor> after,
                                                       std::size_t limit, Channels channels = all_channels());
  boost::asio::awaitable<Result<SamplePage>> samples(RunId run, std::optional<SampleCursor> after, std::size_t limit);
  // At most `limit` of each (1 to 10000), after the cursor.
  boost::asio::awaitable<Result<AbsencePage>> gaps(Excerpt excerpt, std::optional<SampleCursor> after = {},
                                                   std::size_t limit = kMaxPageGaps);
  boost::asio::awaitable<Result<Overview>> overview(Excerpt excerpt, OverviewQuery query);

  // The spans of the excerpt from the cursor's on, with what waits of them. Of the samples that wait only those after
  // the cursor, and of those at least the first `limit`, but all for a window, whose ends they may hold.
  boost::asio::awaitable<Result<std::vector<RecordedSpan>>> spans(Excerpt excerpt,
                                                                  std::optional<SampleCursor> after = {},
                                                                  std::size_t limit = Recorder::kAll);

  // Newest first, by the time at which the station received the event, or was asked for the command.
  boost::asio::awaitable<RecordPage<station::RobotEvent>> events(station::RobotId robot_id, RecordFilter filter);
  boost::asio::awaitable<RecordPage<station::CommandRecord>> commands(station::RobotId robot_id, RecordFilter filter);
  boost::asio::awaitable<Result<station::CommandRecord>> command(station::CommandId id);
  // The same without what waits for the disk: this does not wait for it.
  boost::asio::awaitable<Result<station::CommandRecord>> stored_command(station::CommandId id);

  boost::asio::awaitable<AuditPage> audit(AuditFilter filter);

  // Returns when every command and event that the recorder has received is durable, or false after 3 s when the disk
  // fails.
  boost::asio::awaitable<bool> settle();
  // Returns when all of that and the samples that wait of these spans are durable: for a reader of the database that is
  // another program. unavailable: the disk has not taken them within 3 s.
  boost::asio::awaitable<Result<void>> store_waiting(std::vector<RecordedSpan> spans);

  // For questions of one's own, and for text that is made of what a question gave.
  DatabaseReader& reader() { return reader_; }

 private:
  boost::asio::awaitable<void> add_waiting(RecordedSpan& span, Interval samples, std::size_t& limit) const;
  boost::asio::awaitable<std::vector<RecordedSpan>> in_window(std::vector<RecordedSpan> spans, TimeWindow window);
  boost::asio::awaitable<void> add_missing(const RecordedSpan& span, const std::optional<SampleCursor>& after,
                                           std::size_t limit, AbsencePage& page);

  Recorder& recorder_;
  DatabaseReader reader_;
};

}  // namespace server::storage
