// A part is a member, and a line in each function that concerns it.
#include "server/storage/recording_parts.hpp"

#include <functional>

#include "server/storage/runs/run_store.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

std::filesystem::path backup_folder(const std::filesystem::path& database, const config::RecordingConfig& config) {
  return std::filesystem::absolute(config.backup_dir.empty() ? database.parent_path() / "backups" : config.backup_dir);
}

RecorderOptions with_rescue(RecorderOptions options, const config::RecordingConfig& config) {
  options.rescue = {config.backup_dir, space_limits(config).critical_bytes};
  return options;
}

RetentionPolicy retention_policy(const config::RecordingConfig& config) {
  return {config.retention_days, config.event_retention_days, config.max_database_mb * std::uint64_t{1'000'000}};
}

}  // namespace

RecordingParts::RecordingParts(asio::io_context& loop, runtime::Clock& clock, runtime::WorkerThread& disk,
                               runtime::WorkerThread& readers, runtime::WorkerThread& exports_worker,
                               runtime::WorkerThread& checkpoints, const RecorderOptions& options,
                               const config::RecordingConfig& config)
    : recorder{loop, clock, disk, checkpoints, with_rescue(options, config)},
      head_watch{clock, recorder, checkpoints, options.head_interval},
      reader{options.path, readers},
      removal_clock{clock},
      digester{clock, recorder, reader},
      finalizer{clock, removal_clock, recorder, reader, digester, config.give_up_after_days},
      runs{clock, recorder, reader, digester},
      markers{clock, recorder, reader},
      references{clock, recorder, reader},
      fluid_models{clock, recorder},
      metrics{recorder, reader},
      designs{clock, recorder, reader},
      reservations{clock, recorder, reader},
      jobs{loop, clock, recorder, reader},
      history{options.path, recorder, readers},
      exports{options.path, recorder, exports_worker},
      job_files{clock, removal_clock, exports.reader(), options.path.parent_path() / "job-files"},
      disk_watch{clock, readers, options.path, space_limits(config)},
      backups{loop, clock, recorder, readers, disk_watch, backup_folder(options.path, config)},
      retention{clock, recorder, reader, disk_watch, references, removal_clock, retention_policy(config)},
      groups{clock, recorder, reader},
      path_{options.path} {}

void RecordingParts::connect(station::Station& station) {
  station.add_sink(recorder);
  station.add_sink(runs);
  runs.set_envelope(station.envelope());
  runs.set_on_fluid(std::bind_front(&station::Station::set_fluid, &station));
  recorder.set_on_durable(std::bind_front(&station::Station::on_durable, &station));
  recorder.set_on_missing(std::bind_front(&station::Station::request_resend, &station));
  recorder.set_on_missing_events(std::bind_front(&station::Station::request_event_resend, &station));
  recorder.set_on_returned([&station](const ReturnedSamples& returned) {
    station.note_returned(returned.robot_id, returned.boot_id, returned.range.first, returned.range.next - 1,
                          returned.samples);
  });
}

asio::awaitable<RestoredState> RecordingParts::open() {
  RestoredState restored = co_await recorder.open();
  // SAFETY: of the file that the station works with, whatever has its name later.
  for (DatabaseReader* each : {&reader, &history.reader(), &exports.reader()}) {
    auto open = [](SQLite::Database& database) { return database.execAndGet("PRAGMA schema_version").getInt64(); };
    co_await each->ask(std::move(open));
  }
  auto read_clock = [](SQLite::Database& database) { return read_removal_clock(database); };
  removal_clock.begin(co_await reader.ask(std::move(read_clock)));  // before this start has written by the clock of now
  co_await head_watch.open();
  backups.set_store_id(restored.store_id);
  std::error_code ignored;
  std::filesystem::remove_all(exports_folder(), ignored);  // what a crash left
  co_await runs.load();
  co_await references.open();
  co_await fluid_models.load();
  restored.reservations = co_await reservations.load();
  co_await jobs.load();
  co_await retention.open();
  co_await job_files.open();
  co_await disk_watch.look();
  co_return restored;
}

void RecordingParts::spawn(runtime::TaskGroup& tasks) {
  tasks.spawn("recorder", recorder.run());
  tasks.spawn("checkpoints", recorder.run_checkpoints());
  tasks.spawn("head of the database", head_watch.run());
  tasks.spawn("digester", digester.run());
  tasks.spawn("finalizer", finalizer.run());
  tasks.spawn("runs", runs.run());
  tasks.spawn("disk watch", disk_watch.run());
  tasks.spawn("jobs", jobs.run());
  tasks.spawn("backups", backups.run());
  tasks.spawn("retention", retention.run());
  tasks.spawn("groups of segments", groups.run());
}

void RecordingParts::close() {
  backups.close();
  for (DatabaseReader* each : {&reader, &history.reader(), &exports.reader()}) each->close();
  recorder.close([this](Database& database, std::int64_t utc_us) {  // what fails is done by the next start
    if (runs.any_open()) RunStore{database}.interrupt(utc_us);
    store_removal_clock(database.handle(), removal_clock.state());
  });
  head_watch.close();
}

}  // namespace server::storage
