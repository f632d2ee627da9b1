// Prepared statements, one transaction per batch; row numbers come from a counter that is stored with the rows.
#include "server/storage/commits/sample_store.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <stdexcept>

#include "server/station/state/unknown_values.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/samples/in_force_store.hpp"

namespace server::storage {
namespace {

constexpr std::uint64_t kLogPageBytes = 4096 + 24;  // a page and its header
constexpr int kSegmentPlaceColumns = 12;            // of insert_segment_query(), before those of the table of fields

std::string insert_segment_query() {
  std::string columns =
      "boot_key, first_seq, last_seq, first_row, last_row, first_robot_time_us, period_us, first_received_at_us,"
      " received_at_us, utc_offset_us, clock_uncertainty_us, unknown_values";
  station::for_each_batch_field([&](const auto& field) { columns += fmt::format(", {}", field.name); });
  station::for_each_sample_field([&](const auto& field) { columns += fmt::format(", min_{0}, max_{0}", field.name); });
  std::string marks = "?";
  for (std::size_t column = 1;
       column < kSegmentPlaceColumns + station::kBatchFieldCount + 2 * station::kSampleFieldCount; ++column) {
    marks += ",?";
  }
  return fmt::format("INSERT INTO segment ({}) VALUES ({})", columns, marks);
}

constexpr const char* kInsertGap =
    "INSERT INTO gap (boot_key, first_seq, last_seq, cause, noticed_at_us) VALUES (?,?,?,?,?)";
constexpr const char* kInsertEventGap =
    "INSERT INTO event_gap (boot_key, first_event_seq, last_event_seq, cause, noticed_at_us) VALUES (?,?,?,?,?)";
constexpr const char* kInsertEvent =
    "INSERT INTO event (robot_id, boot_key, event_seq, robot_time_us, sample_seq, kind, cause, mode, sub_state,"
    " position_m, value, emergency_id, command_id, received_at_us, emergency_cause, detail,"
    " unknown_values) VALUES (?1,coalesce(?2,(SELECT boot_key FROM boot WHERE boot_id = ?18)),?3,?4,?5,?6,?7,?8,?9,"
    "?10,?11,?12,?13,?14,?15,?16,?17)";

}  // namespace

bool is_of_interruption(const station::RobotEvent& event) {
  return event.kind == "experiment_paused" || event.kind == "experiment_interrupted";
}

bool WriteBatch::empty() const {
  return new_boots.empty() && segments.empty() && gaps.empty() && events.empty() && event_gaps.empty() &&
         audit.empty() && commands.empty() && clocks.empty() && in_force.empty() && fluids.empty() && boots.empty() &&
         changes.empty();
}

SampleStore::SampleStore(Database& database)
    : database_{database},
      boots_{database},
      next_row_{database.handle().execAndGet("SELECT value FROM meta WHERE name = 'next_row'").getInt64()},
      rows_{database.handle()},
      insert_segment_{database.handle(), insert_segment_query()},
      insert_gap_{database.handle(), kInsertGap},
      insert_event_{database.handle(), kInsertEvent},
      insert_event_gap_{database.handle(), kInsertEventGap},
      audit_{database.handle()},
      commands_{database.handle()},
      advance_row_{database.handle(), "UPDATE meta SET value = ? WHERE name = 'next_row' AND value = ?"},
      advance_boot_{database.handle(),
                    "UPDATE boot SET durable_next_seq = ?, durable_next_event_seq = ?,"
                    " last_robot_time_us = max(last_robot_time_us, ?) WHERE boot_key = ?"},
      count_commit_{database.handle(),
                    "INSERT INTO meta (name, value) VALUES ('commits', 1)"
                    " ON CONFLICT (name) DO UPDATE SET value = value + 1"} {
  const auto on_commit = [](void* use, sqlite3*, const char*, int log_pages) {
    auto& log = *static_cast<LogUse*>(use);
    log.bytes = static_cast<std::uint64_t>(log_pages) * kLogPageBytes;
    ++log.commits;
    return SQLITE_OK;
  };
  sqlite3_wal_hook(database.handle().getHandle(), on_commit, &log_);
}

SampleStore::~SampleStore() { sqlite3_wal_hook(database_.handle().getHandle(), nullptr, nullptr); }

void SampleStore::write(const WriteBatch& batch) {
  SQLite::Transaction transaction{database_.handle(), SQLite::TransactionBehavior::IMMEDIATE};
  boots_.add(batch.new_boots);
  rows_.begin();
  std::int64_t next_row = next_row_;
  for (const Segment& segment : batch.segments) next_row = write_segment(segment, next_row);
  rows_.finish();
  for (const LostRange& gap : batch.gaps) {
    execute(insert_gap_, gap.boot_key, gap.lost.first, gap.lost.next - 1, gap.cause, gap.noticed_at_us);
  }
  for (const StoredEvent& event : batch.events) write_event(event);
  for (const LostRange& gap : batch.event_gaps) {
    execute(insert_event_gap_, gap.boot_key, gap.lost.first, gap.lost.next - 1, gap.cause, gap.noticed_at_us);
  }
  for (const station::AuditNote& note : batch.audit) audit_.append(note);
  for (const station::CommandRecord& command : batch.commands) commands_.write(command, audit_);
  for (const auto& [boot_key, record] : batch.clocks) store_clock(database_.handle(), boot_key, record);
  for (const auto& [boot_key, record] : batch.in_force) store_in_force(database_.handle(), boot_key, record);
  for (const auto& [robot_id, fluid] : batch.fluids) boots_.set_fluid(robot_id, fluid);
  for (const BootProgress& boot : batch.progress) {
    execute(advance_boot_, boot.durable_next_seq, boot.durable_next_event_seq, boot.last_robot_time_us, boot.boot_key);
  }
  for (const BootStart& boot : batch.boots) boots_.start(boot);
  for (const Change& change : batch.changes) change.apply(database_);
  if (next_row != next_row_ && execute(advance_row_, next_row, next_row_) != 1) {
    throw std::runtime_error{"another program writes into the station's database; stop it"};
  }
  execute(count_commit_);
  transaction.commit();
  next_row_ = next_row;
}

std::int64_t SampleStore::write_segment(const Segment& segment, std::int64_t first_row) {
  const auto& [min, max] = rows_.write(segment.samples, first_row);
  const std::int64_t next_row = first_row + static_cast<std::int64_t>(segment.samples.size());
  const station::SampleContext& context = segment.context;
  bind_all(insert_segment_, segment.boot_key, segment.first_seq, segment.next_seq() - 1, first_row, next_row - 1,
           segment.first_robot_time_us, context.period_us, segment.first_received_at_us, segment.received_at_us,
           segment.utc_offset_us, segment.clock_uncertainty_us, unknown_values(context));
  int column = kSegmentPlaceColumns;
  station::for_each_batch_field(
      [&](const auto& field) { bind_value(insert_segment_, ++column, station::text_or_value(context.*field.member)); });
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    bind_value(insert_segment_, ++column, min[channel]);
    bind_value(insert_segment_, ++column, max[channel]);
  }
  insert_segment_.exec();
  insert_segment_.reset();
  return next_row;
}

void SampleStore::write_event(const StoredEvent& stored) {
  const station::RobotEvent& event = stored.event;
  const auto boot_key = stored.boot_key == 0 ? std::nullopt : std::optional{stored.boot_key};
  const auto of_boot = is_of_interruption(event) ? std::optional{event.boot_id} : std::nullopt;
  const auto emergency_cause = event.emergency_cause.transform(
      [](protocol::EmergencyCause cause) { return std::string{protocol::text(cause)}; });
  execute(insert_event_, event.robot_id, boot_key, event.event_seq, event.robot_time_us, event.sample_seq, event.kind,
          event.cause, protocol::text(event.mode), protocol::text(event.sub_state), event.position_m, event.value,
          event.emergency_id, event.command_id, event.received_at_us, emergency_cause, event.detail,
          event.unknown_values, of_boot);
}

}  // namespace server::storage
