// A binary search over the segments of a boot; each probe is one look-up in the index.
#include "server/storage/samples/boot_times.hpp"

#include <algorithm>
#include <limits>
#include <string>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr const char* kColumns =
    "SELECT first_seq, first_robot_time_us, utc_offset_us, period_us FROM segment WHERE boot_key = ?1 AND ";

}  // namespace

BootTimes::BootTimes(SQLite::Database& database)
    : at_or_before_{database, std::string{kColumns} + "first_seq <= ?2 ORDER BY first_seq DESC LIMIT 1"},
      after_{database, std::string{kColumns} + "first_seq > ?2 ORDER BY first_seq LIMIT 1"} {}

void BootTimes::enter(std::int64_t boot_key, std::span<const Segment> waiting) {
  boot_key_ = boot_key;
  waiting_ = waiting;
}

std::optional<SampleTime> BootTimes::of(std::uint64_t seq) {
  std::optional<Place> from = at_or_before(seq);
  if (!from) from = after(seq);
  if (!from) return std::nullopt;
  const std::int64_t periods = static_cast<std::int64_t>(seq) - static_cast<std::int64_t>(from->seq);
  const std::int64_t robot_time_us = from->robot_time_us + periods * from->period_us;
  return SampleTime{static_cast<std::uint64_t>(std::max<std::int64_t>(robot_time_us, 0)),
                    robot_time_us + from->utc_offset_us};
}

std::optional<std::uint64_t> BootTimes::first_from(std::int64_t utc_us) {
  const std::optional<Place> last = at_or_before(std::numeric_limits<std::int64_t>::max());
  if (!last) return std::nullopt;
  const auto at_zero = at_or_before(0);
  const Place first = at_zero ? *at_zero : after(0).value_or(*last);
  std::optional<Place> before;      // the latest found that begins before utc_us
  std::optional<Place> not_before;  // the earliest found that does not
  std::uint64_t begin = first.seq;
  std::uint64_t end = last->seq + 1;
  while (begin < end) {
    const std::uint64_t middle = begin + (end - begin) / 2;
    const Place probe = at_or_before(middle).value_or(first);
    if (probe.utc_us() < utc_us) {
      before = probe;
      begin = middle + 1;  // nothing begins between the probe and the middle
    } else {
      not_before = probe;
      end = probe.seq;
    }
  }
  const std::uint64_t reckoned = before.value_or(first).first_from(utc_us);
  return before && not_before ? std::min(reckoned, not_before->seq) : reckoned;
}

// Reckoned with the period, forwards and backwards.
std::uint64_t BootTimes::Place::first_from(std::int64_t at_us) const {
  const std::int64_t step_us = std::max<std::int64_t>(period_us, 1);
  const std::int64_t ahead_us = at_us - utc_us();
  const std::int64_t samples = ahead_us > 0 ? (ahead_us + step_us - 1) / step_us : -(-ahead_us / step_us);
  if (samples >= 0) return seq + static_cast<std::uint64_t>(samples);
  const auto back = static_cast<std::uint64_t>(-samples);
  return back > seq ? 0 : seq - back;
}

BootTimes::Place BootTimes::place_of(const Segment& segment) {
  return {segment.first_seq, static_cast<std::int64_t>(segment.first_robot_time_us), segment.utc_offset_us,
          segment.context.period_us};
}

std::optional<BootTimes::Place> BootTimes::at_or_before(std::uint64_t seq) {
  std::optional<Place> found = read(at_or_before_, seq);
  for (const Segment& segment : waiting_) {
    const bool later = !found || segment.first_seq > found->seq;
    if (segment.first_seq <= seq && later) found = place_of(segment);
  }
  return found;
}

std::optional<BootTimes::Place> BootTimes::after(std::uint64_t seq) {
  std::optional<Place> found = read(after_, seq);
  for (const Segment& segment : waiting_) {
    const bool earlier = !found || segment.first_seq < found->seq;
    if (segment.first_seq > seq && earlier) found = place_of(segment);
  }
  return found;
}

std::optional<BootTimes::Place> BootTimes::read(SQLite::Statement& query, std::uint64_t seq) const {
  bind_all(query, boot_key_, seq);
  if (!query.executeStep()) return std::nullopt;
  const Place place{unsigned_id(query.getColumn(0)), query.getColumn(1).getInt64(), query.getColumn(2).getInt64(),
                    query.getColumn(3).getInt64()};
  query.reset();
  return place;
}

}  // namespace server::storage
