// Documents are found by their hash.
#include "server/storage/samples/in_force_store.hpp"

#include <sodium.h>

#include <array>

#include "server/storage/database/statement.hpp"
#include "server/storage/samples/in_force_json.hpp"

namespace server::storage {

std::int64_t document_key(SQLite::Database& database, const std::string& kind, const std::string& content) {
  std::array<unsigned char, crypto_hash_sha256_BYTES> hash{};
  crypto_hash_sha256(hash.data(), reinterpret_cast<const unsigned char*>(content.data()), content.size());
  SQLite::Statement add{database, "INSERT OR IGNORE INTO document (kind, sha256, content) VALUES (?, ?, ?)"};
  bind_all(add, kind);
  add.bind(2, hash.data(), static_cast<int>(hash.size()));
  add.bind(3, content);
  add.exec();
  SQLite::Statement find{database, "SELECT document_key FROM document WHERE kind = ? AND sha256 = ?"};
  bind_all(find, kind);
  find.bind(2, hash.data(), static_cast<int>(hash.size()));
  find.executeStep();
  return find.getColumn(0).getInt64();
}

void store_in_force(SQLite::Database& database, std::int64_t boot_key, const station::InForceRecord& record) {
  const std::string kind = kind_of(record.content);
  const std::int64_t key = document_key(database, kind, document_text(record.content));
  SQLite::Statement latest{database,
                           "SELECT document_key FROM in_force WHERE boot_key = ? AND kind = ? AND first_seq <= ?"
                           " ORDER BY first_seq DESC LIMIT 1"};
  bind_all(latest, boot_key, kind, record.first_seq);
  const bool is_first = !latest.executeStep();
  if (!is_first && latest.getColumn(0).getInt64() == key) return;  // reported again after a reconnection
  // Nobody can have changed it before the boot's first report.
  const std::uint64_t first_seq = is_first && !record.is_change ? 0 : record.first_seq;
  SQLite::Statement add{database,
                        "INSERT OR REPLACE INTO in_force (boot_key, kind, first_seq, document_key, noticed_at_us)"
                        " VALUES (?, ?, ?, ?, ?)"};
  execute(add, boot_key, kind, first_seq, key, record.noticed_at_us);
}

void store_clock(SQLite::Database& database, std::int64_t boot_key, const station::ClockRecord& record) {
  SQLite::Statement add{database,
                        "INSERT OR REPLACE INTO clock_estimate (boot_key, robot_time_us, utc_offset_us, uncertainty_us,"
                        " drift_ppm, round_trip_us, station_step_us) VALUES (?, ?, ?, ?, ?, ?, ?)"};
  execute(add, boot_key, record.robot_time_us, record.utc_offset_us, record.uncertainty_us, record.drift_ppm,
          record.round_trip_us, record.station_step_us);
}

}  // namespace server::storage
