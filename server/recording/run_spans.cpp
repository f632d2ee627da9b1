// A bisection over the numbers of a boot's samples.
#include "server/recording/run_spans.hpp"

#include <algorithm>
#include <string>

#include "server/recording/statement.hpp"

namespace server {
namespace {

class BootTimes {
 public:
  BootTimes(SQLite::Database& database, std::int64_t boot_key) : database_{database}, boot_key_{boot_key} {}

  std::optional<SampleTime> of(std::uint64_t seq) {
    for (SQLite::Statement* query : {&before_, &after_}) {
      bind_all(*query, boot_key_, seq);
      if (!query->executeStep()) continue;
      const std::int64_t periods = static_cast<std::int64_t>(seq) - query->getColumn(0).getInt64();
      const std::int64_t robot_time_us = query->getColumn(1).getInt64() + periods * query->getColumn(2).getInt64();
      const std::int64_t utc_us = robot_time_us + query->getColumn(3).getInt64();
      query->reset();
      return SampleTime{static_cast<std::uint64_t>(std::max<std::int64_t>(robot_time_us, 0)), utc_us};
    }
    return std::nullopt;
  }

  // The first sample below `end` that is not before the time.
  std::uint64_t first_from(std::int64_t utc_us, std::uint64_t end) {
    std::uint64_t first = 0;
    while (first < end) {
      const std::uint64_t middle = first + (end - first) / 2;
      if (of(middle)->utc_us < utc_us) {
        first = middle + 1;
      } else {
        end = middle;
      }
    }
    return first;
  }

 private:
  static constexpr const char* kColumns =
      "SELECT first_seq, first_robot_time_us, period_us, utc_offset_us FROM segment";

  SQLite::Database& database_;
  std::int64_t boot_key_;
  SQLite::Statement before_{
      database_, std::string{kColumns} + " WHERE boot_key = ? AND first_seq <= ? ORDER BY first_seq DESC LIMIT 1"};
  SQLite::Statement after_{database_,
                           std::string{kColumns} + " WHERE boot_key = ? AND first_seq > ? ORDER BY first_seq LIMIT 1"};
};

}  // namespace

std::optional<SampleTime> time_of(SQLite::Database& database, std::int64_t boot_key, std::uint64_t seq) {
  return BootTimes{database, boot_key}.of(seq);
}

std::vector<BootSamples> samples_between(SQLite::Database& database, const RobotId& robot_id, std::int64_t from_us,
                                         std::int64_t to_us) {
  std::vector<BootSamples> found;
  SQLite::Statement boots{database, "SELECT boot_key, boot_id FROM boot WHERE robot_id = ? ORDER BY boot_key"};
  bind_all(boots, robot_id);
  while (boots.executeStep()) {
    BootSamples boot{boots.getColumn(0).getInt64(), unsigned_id(boots.getColumn(1)), {}};
    const std::uint64_t end = known_next_seq(database, {}, boot.boot_key, boot.boot_id);
    BootTimes times{database, boot.boot_key};
    if (end == 0 || !times.of(0)) continue;
    boot.samples = {times.first_from(from_us, end), times.first_from(to_us + 1, end)};
    if (boot.samples.first < boot.samples.next) found.push_back(boot);
  }
  return found;
}

std::optional<BootSample> sample_at(SQLite::Database& database, const BootHeads& heads, const RobotId& robot_id,
                                    std::int64_t utc_us) {
  SQLite::Statement boots{database, "SELECT boot_key, boot_id FROM boot WHERE robot_id = ? ORDER BY boot_key DESC"};
  bind_all(boots, robot_id);
  while (boots.executeStep()) {
    BootSample sample{boots.getColumn(0).getInt64(), unsigned_id(boots.getColumn(1)), 0};
    const std::uint64_t end = known_next_seq(database, heads, sample.boot_key, sample.boot_id);
    BootTimes times{database, sample.boot_key};
    const std::optional<SampleTime> begin = times.of(0);
    if (end == 0 || !begin || begin->utc_us > utc_us) continue;
    sample.seq = std::max<std::uint64_t>(times.first_from(utc_us + 1, end), 1) - 1;
    return sample;
  }
  return std::nullopt;
}

std::optional<BootSamples> samples_of_boot(SQLite::Database& database, const RobotId& robot_id, BootId boot_id) {
  SQLite::Statement boot{database, "SELECT boot_key FROM boot WHERE boot_id = ? AND robot_id = ?"};
  bind_all(boot, boot_id, robot_id);
  if (!boot.executeStep()) return std::nullopt;
  const std::int64_t boot_key = boot.getColumn(0).getInt64();
  return BootSamples{boot_key, boot_id, {0, known_next_seq(database, {}, boot_key, boot_id)}};
}

}  // namespace server
