// A binary search over the segments of a boot; each probe is one look-up in the index.
#include "server/recording/span_finder.hpp"

#include <algorithm>
#include <limits>
#include <optional>

#include "server/recording/statement.hpp"

namespace server {
namespace {

// Where a segment lies in numbers and in time.
struct Place {
  std::uint64_t first_seq = 0;
  std::uint64_t next_seq = 0;
  std::int64_t first_utc_us = 0;
  std::int64_t period_us = 0;
};

Place place_of(const Segment& segment) {
  return {segment.first_seq, segment.next_seq(),
          static_cast<std::int64_t>(segment.first_robot_time_us) + segment.utc_offset_us, segment.context.period_us};
}

class Places {
 public:
  explicit Places(SQLite::Database& database)
      : at_or_before_{database, std::string{kColumns} + "first_seq <= ?2 ORDER BY first_seq DESC LIMIT 1"},
        after_{database, std::string{kColumns} + "first_seq > ?2 ORDER BY first_seq LIMIT 1"} {}

  // From now on those of this span's boot; it outlives the next look.
  void enter(const RecordedSpan& span) {
    waiting_ = &span.waiting;
    boot_key_ = span.boot_key;
  }

  // The last one that begins at the number or before it, and the first one that begins after it.
  std::optional<Place> at_or_before(std::uint64_t seq) {
    std::optional<Place> found = read(at_or_before_, seq);
    for (const Segment& segment : *waiting_) {
      const bool later = !found || segment.first_seq > found->first_seq;
      if (segment.first_seq <= seq && later) found = place_of(segment);
    }
    return found;
  }
  std::optional<Place> after(std::uint64_t seq) {
    std::optional<Place> found = read(after_, seq);
    for (const Segment& segment : *waiting_) {
      const bool earlier = !found || segment.first_seq < found->first_seq;
      if (segment.first_seq > seq && earlier) found = place_of(segment);
    }
    return found;
  }

 private:
  static constexpr const char* kColumns =
      "SELECT first_seq, last_seq + 1, first_robot_time_us + utc_offset_us, period_us FROM segment"
      " WHERE boot_key = ?1 AND ";

  std::optional<Place> read(SQLite::Statement& query, std::uint64_t seq) const {
    bind_all(query, boot_key_, seq);
    if (!query.executeStep()) return std::nullopt;
    const Place place{unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)), query.getColumn(2).getInt64(),
                      query.getColumn(3).getInt64()};
    query.reset();
    return place;
  }

  SQLite::Statement at_or_before_;
  SQLite::Statement after_;
  const std::vector<Segment>* waiting_ = nullptr;
  std::int64_t boot_key_ = 0;
};

// The number of the first sample at the time or after it, reckoned from a place with its period.
std::uint64_t reckon(const Place& from, std::int64_t utc_us) {
  const std::int64_t period_us = std::max<std::int64_t>(from.period_us, 1);
  const std::int64_t ahead_us = utc_us - from.first_utc_us;
  const std::int64_t samples = ahead_us > 0 ? (ahead_us + period_us - 1) / period_us : -(-ahead_us / period_us);
  if (samples >= 0) return from.first_seq + static_cast<std::uint64_t>(samples);
  const auto back = static_cast<std::uint64_t>(-samples);
  return back > from.first_seq ? 0 : from.first_seq - back;
}

// The number of the first sample at utc_us or after it. `last` is the last segment of the boot. Where the station's
// clock was set back a time may occur twice, and this is one of the two places; a time that occurs is always found.
std::uint64_t seq_at(Places& places, const Place& first, const Place& last, std::int64_t utc_us) {
  std::optional<Place> before;  // the latest found that begins before utc_us
  std::optional<Place> after;   // the earliest found that begins at utc_us or after it
  std::uint64_t begin = first.first_seq;
  std::uint64_t end = last.first_seq + 1;
  while (begin < end) {
    const std::uint64_t middle = begin + (end - begin) / 2;
    const Place probe = places.at_or_before(middle).value_or(first);
    if (probe.first_utc_us < utc_us) {
      before = probe;
      begin = middle + 1;  // nothing begins between the probe and the middle
    } else {
      after = probe;
      end = probe.first_seq;
    }
  }
  const std::uint64_t reckoned = reckon(before.value_or(first), utc_us);
  return before && after ? std::min(reckoned, after->first_seq) : reckoned;
}

}  // namespace

std::vector<RecordedSpan> cut_to_window(SQLite::Database& database, std::vector<RecordedSpan> spans,
                                        TimeWindow window) {
  std::vector<RecordedSpan> found;
  Places places{database};
  for (RecordedSpan& span : spans) {
    places.enter(span);
    constexpr std::uint64_t kLargest = std::numeric_limits<std::int64_t>::max();
    const auto last = places.at_or_before(kLargest);
    if (!last) continue;
    const auto at_zero = places.at_or_before(0);
    const Place first = at_zero ? *at_zero : places.after(0).value_or(*last);
    span.cut({seq_at(places, first, *last, window.from_us), seq_at(places, first, *last, window.to_us)});
    if (span.made().next > span.samples.first) found.push_back(std::move(span));
  }
  return found;
}

}  // namespace server
