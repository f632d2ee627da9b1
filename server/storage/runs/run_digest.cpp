// Counting, and the bytes that are hashed.
#include "server/storage/runs/run_digest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <tuple>

namespace server::storage {
namespace {

constexpr std::size_t kPlaceBytes = 40;  // boot_id, seq, times
constexpr std::size_t kMaxSampleBytes = [] {
  std::size_t bytes = kPlaceBytes + 4 * station::kSampleFieldCount;
  station::for_each_batch_field([&](const auto& field) { bytes += field.kKind == station::FieldKind::id ? 8 : 4; });
  return bytes;
}();

std::string preamble(int format) { return fmt::format("rheonaut-samples-{}\n", format); }

class ByteWriter {
 public:
  explicit ByteWriter(unsigned char* into) : at_{into} {}

  template <class Integer>
  void put(Integer value) {
    for (std::size_t byte = 0; byte < sizeof value; ++byte) *at_++ = static_cast<unsigned char>(value >> (8 * byte));
  }
  // Format 1 had a byte for each enumerator, and 0 for those that it did not know.
  template <class Enumerator>
  void put_enumerator(Enumerator value, int format) {
    format == 1 ? put(static_cast<std::uint8_t>(value)) : put(static_cast<std::uint32_t>(value));
  }
  std::size_t bytes_since(const unsigned char* begin) const { return static_cast<std::size_t>(at_ - begin); }
  void put_float(float value) { put(std::isnan(value) ? 0x7fc00000U : std::bit_cast<std::uint32_t>(value)); }

 private:
  unsigned char* at_;
};

// What samples share: numbers, enumerators, counts, ids, each in the order of the table.
void write_context(ByteWriter& bytes, int format, const station::SampleContext& context) {
  const auto is_in = [format](const auto& field) { return field.since_digest <= format; };
  station::for_each_batch_field_of<station::FieldKind::number>([&](const auto& field) {
    if (is_in(field)) bytes.put_float(station::or_nan(context.*field.member));
  });
  station::for_each_batch_field_of<station::FieldKind::enumerator>([&](const auto& field) {
    if (is_in(field)) bytes.put_enumerator(context.*field.member, format);
  });
  if (format == 1) bytes.put(std::uint8_t{0});  // after three bytes of enumerators
  const auto put = [&](const auto& field) {
    if (is_in(field)) bytes.put(context.*field.member);
  };
  station::for_each_batch_field_of<station::FieldKind::count>(put);
  station::for_each_batch_field_of<station::FieldKind::id>(put);
}

// How many bytes it wrote.
std::size_t write_sample(unsigned char* into, int format, station::BootId boot_id, const Segment& segment,
                         std::size_t index) {
  const station::Sample& sample = segment.samples[index];
  const std::uint64_t robot_time_us = segment.robot_time_us(index);
  ByteWriter bytes{into};
  bytes.put(boot_id);
  bytes.put(segment.first_seq + index);
  bytes.put(robot_time_us);
  bytes.put(robot_time_us + std::bit_cast<std::uint64_t>(segment.utc_offset_us));
  bytes.put(std::bit_cast<std::uint64_t>(segment.clock_uncertainty_us));
  station::for_each_sample_field([&](const station::SampleField& field) {
    if (field.since_digest <= format) bytes.put_float(sample.*field.member);
  });
  write_context(bytes, format, segment.context);
  return bytes.bytes_since(into);
}

}  // namespace

bool RunDigest::agrees_with(const RunDigest& other) const {
  const auto all = [](const RunDigest& one) {
    return std::tie(one.samples_expected, one.samples_live, one.samples_backfilled, one.samples_lost, one.lost_by_cause,
                    one.longest_gap_samples, one.longest_gap_us, one.worst_clock_uncertainty_us,
                    one.samples_without_clock, one.sha256);
  };
  const bool both_counted = missed && other.missed;
  return all(*this) == all(other) && (!both_counted || missed == other.missed);
}

SampleHash::SampleHash(int format) : format_{format} {
  const std::string begin = preamble(format);
  crypto_hash_sha256_init(&state_);
  crypto_hash_sha256_update(&state_, reinterpret_cast<const unsigned char*>(begin.data()), begin.size());
}

void SampleHash::add(station::BootId boot_id, const Segment& segment) {
  std::array<unsigned char, 100 * kMaxSampleBytes> bytes;
  std::size_t used = 0;
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    if (used + kMaxSampleBytes > bytes.size()) {
      crypto_hash_sha256_update(&state_, bytes.data(), used);
      used = 0;
    }
    used += write_sample(bytes.data() + used, format_, boot_id, segment, index);
  }
  crypto_hash_sha256_update(&state_, bytes.data(), used);
}

std::string SampleHash::text() const {
  crypto_hash_sha256_state state = state_;  // so that more may follow
  std::array<unsigned char, crypto_hash_sha256_BYTES> hash{};
  crypto_hash_sha256_final(&state, hash.data());
  std::string text(2 * hash.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
  text.pop_back();
  return text;
}

void SampleTally::begin_span(Interval samples, std::uint32_t period_us) {
  span_ = samples;
  next_seq_ = samples.first;
  period_us_ = period_us;
  last_.reset();
  counts_.samples_expected += samples.next - samples.first;
}

void SampleTally::add(const Stretch& stretch) {
  const std::uint64_t samples = stretch.samples.next - stretch.samples.first;
  const Tick first{stretch.samples.first, stretch.first_robot_time_us, stretch.period_us};
  const bool is_backfill = (stretch.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) != 0;
  period_us_ = stretch.period_us;
  if (first.seq > next_seq_) {
    const std::uint64_t missing = first.seq - next_seq_;
    note_gap(missing, static_cast<std::int64_t>(last_ ? first.robot_time_us - last_->robot_time_us - last_->period_us
                                                      : missing * stretch.period_us));
  }
  const std::uint64_t ticks = last_ ? missed_ticks(*last_, first) : 0;
  counts_.missed->count += ticks;
  counts_.missed->longest = std::max(counts_.missed->longest, ticks);
  (is_backfill ? counts_.samples_backfilled : counts_.samples_live) += samples;
  if (stretch.clock_uncertainty_us < 0) counts_.samples_without_clock += samples;
  counts_.worst_clock_uncertainty_us = std::max(counts_.worst_clock_uncertainty_us, stretch.clock_uncertainty_us);
  next_seq_ = stretch.samples.next;
  last_ = Tick{next_seq_ - 1, first.robot_time_us + (samples - 1) * stretch.period_us, stretch.period_us};
}

void SampleTally::add_lost(Interval samples, const std::string& cause) {
  counts_.samples_lost += samples.next - samples.first;
  counts_.lost_by_cause[cause] += samples.next - samples.first;
}

void SampleTally::end_span() {
  if (next_seq_ >= span_.next) return;
  note_gap(span_.next - next_seq_, static_cast<std::int64_t>((span_.next - next_seq_) * period_us_));
}

void SampleTally::note_gap(std::uint64_t samples, std::int64_t us) {
  counts_.longest_gap_samples = std::max(counts_.longest_gap_samples, samples);
  counts_.longest_gap_us = std::max(counts_.longest_gap_us, us);
}

DigestComputation::DigestComputation(std::vector<DigestSpan> spans, int format)
    : spans_{std::move(spans)}, format_{format}, hash_{format} {
  if (spans_.empty()) return;
  next_seq_ = spans_[0].samples.first;
  tally_.begin_span(spans_[0].samples, spans_[0].period_us);
}

DigestComputation::Progress DigestComputation::advance(SQLite::Database& database, std::uint64_t max_samples) {
  while (span_ < spans_.size()) {
    const Progress progress = advance_span(database, max_samples);
    if (progress != Progress::done) return progress;
    tally_.end_span();
    if (++span_ == spans_.size()) break;
    next_seq_ = spans_[span_].samples.first;
    tally_.begin_span(spans_[span_].samples, spans_[span_].period_us);
  }
  return Progress::done;
}

RunDigest DigestComputation::digest() const {
  RunDigest digest = tally_.counts();
  digest.format = format_;
  digest.sha256 = hash_.text();
  return digest;
}

std::string DigestComputation::place() const {
  return span_ < spans_.size() ? fmt::format("sample {} of boot {}", next_seq_, spans_[span_].boot_id) : "nothing";
}

}  // namespace server::storage
