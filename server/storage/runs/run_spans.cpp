// SQL over the boots of a robot; within a boot BootTimes searches.
#include "server/storage/runs/run_spans.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr int kBootsAtOnce = 32;  // in one call; two searches each, under 0.5 ms

}  // namespace

std::optional<SampleTime> time_of(SQLite::Database& database, std::int64_t boot_key, std::uint64_t seq) {
  BootTimes times{database};
  times.enter(boot_key);
  return times.of(seq);
}

std::optional<BootSample> sample_at(SQLite::Database& database, const BootHeads& heads,
                                    const station::RobotId& robot_id, std::int64_t utc_us) {
  SQLite::Statement boots{database, "SELECT boot_key, boot_id FROM boot WHERE robot_id = ? ORDER BY boot_key DESC"};
  bind_all(boots, robot_id);
  BootTimes times{database};
  while (boots.executeStep()) {
    BootSample sample{boots.getColumn(0).getInt64(), unsigned_id(boots.getColumn(1)), 0};
    times.enter(sample.boot_key);
    const std::optional<SampleTime> begin = times.of(0);
    if (!begin || begin->utc_us > utc_us) continue;
    const std::uint64_t end = known_next_seq(database, heads, sample.boot_key, sample.boot_id);
    const std::uint64_t next = std::min(times.first_from(utc_us + 1).value_or(0), end);
    sample.seq = std::max<std::uint64_t>(next, 1) - 1;
    return sample;
  }
  return std::nullopt;
}

std::optional<BootSamples> samples_of_boot(SQLite::Database& database, const station::RobotId& robot_id,
                                           station::BootId boot_id) {
  SQLite::Statement boot{database, "SELECT boot_key FROM boot WHERE boot_id = ? AND robot_id = ?"};
  bind_all(boot, boot_id, robot_id);
  if (!boot.executeStep()) return std::nullopt;
  const std::int64_t boot_key = boot.getColumn(0).getInt64();
  return BootSamples{boot_key, boot_id, {0, known_next_seq(database, {}, boot_key, boot_id)}};
}

bool RangeSearch::advance(SQLite::Database& database) {
  const SQLite::Transaction moment{database};
  if (const auto* time = std::get_if<TimeSpan>(&range_)) {
    if (search_time(database, *time)) return true;
  } else {
    search_boot(database, std::get<SeqSpan>(range_));
  }
  if (found_) describe(database);
  return false;
}

bool RangeSearch::search_time(SQLite::Database& database, const TimeSpan& time) {
  SQLite::Statement boots{database,
                          "SELECT boot_key, boot_id FROM boot WHERE robot_id = ? AND boot_key > ?"
                          " ORDER BY boot_key LIMIT ?"};
  bind_all(boots, robot_id_, boot_key_, std::int64_t{kBootsAtOnce});
  BootTimes times{database};
  int looked_at = 0;
  for (; boots.executeStep(); ++looked_at) {
    BootSamples boot{boots.getColumn(0).getInt64(), unsigned_id(boots.getColumn(1)), {}};
    boot_key_ = boot.boot_key;
    times.enter(boot.boot_key);
    const auto first = times.first_from(time.from_us);
    if (!first) continue;
    const std::uint64_t end = known_next_seq(database, {}, boot.boot_key, boot.boot_id);
    boot.samples = {*first, std::min(times.first_from(time.to_us + 1).value_or(0), end)};
    if (boot.samples.first < boot.samples.next) found_->boots.push_back(boot);
  }
  found_->by_time = true;
  if (looked_at == kBootsAtOnce) return true;
  if (found_->boots.empty()) {
    found_ = fail(ErrorCode::invalid, fmt::format("nothing was recorded of robot '{}' in that time", robot_id_),
                  "nothing_recorded");
  }
  return false;
}

void RangeSearch::search_boot(SQLite::Database& database, const SeqSpan& named) {
  std::optional<BootSamples> boot = samples_of_boot(database, robot_id_, named.boot_id);
  if (!boot) {
    found_ = fail(ErrorCode::not_found, fmt::format("robot '{}' has had no boot {}", robot_id_, named.boot_id));
    return;
  }
  if (named.first_seq > named.last_seq || named.last_seq >= boot->samples.next) {
    found_ = fail(ErrorCode::invalid,
                  fmt::format("samples {} to {} are not in the boot's 0 to {}", named.first_seq, named.last_seq,
                              static_cast<std::int64_t>(boot->samples.next) - 1),
                  "nothing_recorded");
    return;
  }
  boot->samples = {named.first_seq, named.last_seq + 1};
  found_->boots.push_back(*boot);
}

void RangeSearch::describe(SQLite::Database& database) {
  const BootSamples& first = found_->boots.front();
  const BootSamples& last = found_->boots.back();
  SQLite::Statement boot{database, "SELECT firmware_version, first_seen_at_us FROM boot WHERE boot_key = ?"};
  bind_all(boot, first.boot_key);
  boot.executeStep();
  found_->firmware_version = boot.getColumn(0).getString();
  found_->started_at_us = boot.getColumn(1).getInt64();
  SQLite::Statement segment{database,
                            "SELECT controller_id FROM segment WHERE boot_key = ? AND first_seq <= ?"
                            " ORDER BY first_seq DESC LIMIT 1"};
  bind_all(segment, first.boot_key, first.samples.first);
  if (segment.executeStep()) found_->controller_id = segment.getColumn(0).getUInt();
  if (const auto time = time_of(database, first.boot_key, first.samples.first)) found_->started_at_us = time->utc_us;
  found_->ended_at_us = found_->started_at_us;
  if (const auto time = time_of(database, last.boot_key, last.samples.next - 1)) {
    found_->ended_at_us = std::max(found_->started_at_us, time->utc_us);
  }
}

}  // namespace server::storage
