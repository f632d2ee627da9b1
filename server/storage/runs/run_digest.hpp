// The digest of a run: how many samples were expected, received and lost, and a SHA-256 over them.
//
//   hashed = "rheonaut-samples-2\n" sample*                                 in order of span and seq
//   sample = boot_id:u64 seq:u64 robot_time_us:u64 utc_us:i64 clock_uncertainty_us:i64
//            kSampleFields:f32*  numbers:f32* enumerators:i32* counts:u32* ids:u64* of kBatchFields       104 bytes
//
// Of the fields (telemetry_fields.hpp) a digest contains those whose since_digest is not above its format.
// Little-endian; f32 is binary32, a NaN and a value that is not there are 0x7fc00000; enumerators are the numbers of
// the robot's protocol, also those that this version does not know. Format 1, of digests made before schema 7,
// has "rheonaut-samples-1\n", and each enumerator as u8 with a 0:u8 after them, 96 bytes. How samples are cut into
// segments and where their rows lie is not in it, so it is the same after a backup, an export or a VACUUM; nor is what
// people said of the run, which they may change. docs/database.md repeats this for those who check it with another
// program.
//
// Pure, but for advance(), which are called on the thread that owns the database handle and end within a
// page. A broken promise of the database (a row that is not there) is an exception.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <sodium.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/runs/run.hpp"
#include "server/storage/samples/segment.hpp"

namespace server::storage {

inline constexpr int kDigestFormat = station::newest_digest_format();  // of new ones; older ones are verified for ever

struct RunDigest {
  int format = kDigestFormat;
  std::uint64_t samples_expected = 0;
  std::uint64_t samples_live = 0;
  std::uint64_t samples_backfilled = 0;  // sent again, on request or after a reconnect
  std::uint64_t samples_lost = 0;
  std::map<std::string, std::uint64_t> lost_by_cause;
  std::uint64_t longest_gap_samples = 0;         // the longest stretch of a span without a sample
  std::int64_t longest_gap_us = 0;               // the same in robot time, which also counts periods that it skipped
  std::int64_t worst_clock_uncertainty_us = -1;  // -1: no sample has an estimate
  std::uint64_t samples_without_clock = 0;
  std::string sha256;  // in lower-case hexadecimal
  std::int64_t made_at_us = 0;
  std::optional<MissedTicks> missed;  // none: made by a version that did not count them

  std::uint64_t samples_missing() const {  // still on their way
    return samples_expected - samples_live - samples_backfilled - samples_lost;
  }
  // Says the same of the samples; when it was made does not count, nor what one of them has not counted.
  bool agrees_with(const RunDigest& other) const;
};

class SampleHash {
 public:
  explicit SampleHash(int format);
  void add(station::BootId boot_id, const Segment& segment);
  std::string text() const;  // of all so far

 private:
  int format_;
  crypto_hash_sha256_state state_;
};

// Counts a run, span by span.
class SampleTally {
 public:
  // The period is that of the boot, for the time of a span that has no sample.
  void begin_span(Interval samples, std::uint32_t period_us);
  // Stored samples of the span, ascending.
  struct Stretch {
    Interval samples;
    std::uint64_t first_robot_time_us = 0;
    std::uint32_t period_us = 0;
    std::uint32_t flags = 0;
    std::int64_t clock_uncertainty_us = -1;
  };
  void add(const Stretch& stretch);
  void add_lost(Interval samples, const std::string& cause);
  void end_span();

  const RunDigest& counts() const { return counts_; }

 private:
  void note_gap(std::uint64_t samples, std::int64_t us);

  RunDigest counts_{.lost_by_cause = {}, .sha256 = {}, .missed = MissedTicks{}};
  Interval span_;
  std::uint64_t next_seq_ = 0;  // of the span: above the last stored sample
  std::optional<Tick> last_;    // of the span: the last stored sample
  std::uint32_t period_us_ = 0;
};

// One span of a closed run.
struct DigestSpan {
  std::int64_t boot_key = 0;
  station::BootId boot_id = 0;
  Interval samples;
  std::uint32_t period_us = 0;
};
std::vector<DigestSpan> read_digest_spans(SQLite::Database& database, RunId run);

// Computes a digest: reads the samples once, in pages, and stops at the first sample that is still missing.
class DigestComputation {
 public:
  enum class Progress : std::uint8_t { more, waiting, done };

  explicit DigestComputation(std::vector<DigestSpan> spans, int format = kDigestFormat);

  // Reads at most about `max_samples` samples.
  Progress advance(SQLite::Database& database, std::uint64_t max_samples);

  // Of the samples read so far.
  RunDigest digest() const;
  // The sample that comes next, for messages.
  std::string place() const;

 private:
  Progress advance_span(SQLite::Database& database, std::uint64_t& max_samples);

  std::vector<DigestSpan> spans_;
  std::size_t span_ = 0;
  std::uint64_t next_seq_ = 0;  // of that span
  SampleTally tally_;
  int format_;
  SampleHash hash_;
};

// The counts of a run with missing samples, from the heads of its segments; the hash is empty.
class HeadTally {
 public:
  explicit HeadTally(std::vector<DigestSpan> spans = {}) : spans_{std::move(spans)} {}

  // Reads a page; false at the end.
  bool advance(SQLite::Database& database);

  const RunDigest& counts() const { return tally_.counts(); }

 private:
  std::vector<DigestSpan> spans_;
  std::size_t span_ = 0;
  std::uint64_t next_seq_ = 0;  // of that span, once it has begun
  bool has_begun_ = false;
  SampleTally tally_;
};

std::optional<RunDigest> read_digest(SQLite::Database& database, RunId run);

// Does nothing when the run has been discarded meanwhile.
void write_digest(SQLite::Database& database, RunId run, const RunDigest& digest);

// Into a digest that has not counted them, if it is of as many stored samples.
void write_missed_ticks(SQLite::Database& database, RunId run, const RunDigest& counts);

}  // namespace server::storage
