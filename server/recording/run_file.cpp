// The run's rows of other tables are copied by SQLite itself; samples come through the scanner.
#include "server/recording/run_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <stdexcept>

#include "server/recording/schema.hpp"
#include "server/recording/statement.hpp"

namespace server {
namespace {

constexpr std::size_t kSliceSamples = 2'500;

constexpr const char* kTables = R"sql(
CREATE TABLE sample (
  span INTEGER NOT NULL,
  boot_id TEXT NOT NULL,
  seq INTEGER NOT NULL,
  robot_time_us INTEGER NOT NULL,
  utc_us INTEGER NOT NULL,
  clock_uncertainty_us INTEGER NOT NULL,   -- half-width; -1: there was no estimate
  first_received_at_us INTEGER NOT NULL,
  received_at_us INTEGER NOT NULL,
  position_m REAL,
  velocity_m_s REAL,
  acceleration_m_s2 REAL,
  duty REAL,
  impedance_mv REAL,
  reference_m REAL,
  mode TEXT NOT NULL,
  sub_state TEXT NOT NULL,
  setpoint_m REAL,
  disturbance_m REAL,
  position_sd_m REAL,
  controller_id INTEGER NOT NULL,
  emergency_id TEXT NOT NULL,
  emergency_cause TEXT NOT NULL,
  flags INTEGER NOT NULL,
  gap_before INTEGER NOT NULL              -- samples that are missing right before this one
);
CREATE TABLE gap (
  boot_id TEXT NOT NULL,
  first_seq INTEGER NOT NULL,
  last_seq INTEGER NOT NULL,
  cause TEXT NOT NULL,
  noticed_at_us INTEGER NOT NULL
);
)sql";

// {0} is the run. A robot's events are those of its samples, whenever they came; events of the station itself, and
// commands, are of the time between the run's beginning and its end.
constexpr const char* kCopies = R"sql(
CREATE TABLE run AS SELECT * FROM store.run WHERE run_id = {0};
CREATE TABLE span AS SELECT span, printf('%llu', boot_id) AS boot_id, first_seq, last_seq, firmware_version
  FROM store.run_span JOIN store.boot USING (boot_key) WHERE run_id = {0} ORDER BY span;
CREATE TABLE event AS SELECT robot_event.* FROM store.run JOIN store.robot_event USING (robot_id)
  WHERE run_id = {0} AND (EXISTS (SELECT 1 FROM span WHERE span.boot_id = robot_event.boot_id AND event_seq IS NOT NULL
      AND sample_seq >= first_seq AND sample_seq <= coalesce(last_seq, 9223372036854775807))
    OR (event_seq IS NULL AND received_at_us >= started_at_us
      AND received_at_us <= coalesce(ended_at_us, 9223372036854775807)));
CREATE TABLE command AS SELECT robot_command.* FROM store.run JOIN store.robot_command USING (robot_id)
  WHERE run_id = {0} AND submitted_at_us >= started_at_us
  AND submitted_at_us <= coalesce(run.ended_at_us, 9223372036854775807);
CREATE TABLE marker AS SELECT * FROM store.run_marker WHERE run_id = {0};
CREATE TABLE run_certificate AS SELECT * FROM store.run_certificate WHERE run_id = {0};
CREATE TABLE in_force AS SELECT * FROM store.run_in_force WHERE run_id = {0};
)sql";

constexpr const char* kInsert = "INSERT INTO sample VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)";

std::int64_t signed_seq(std::uint64_t seq) { return static_cast<std::int64_t>(seq); }

}  // namespace

RunFile::RunFile(std::filesystem::path path, std::string store, std::vector<RecordedSpan> spans, ExportQuery query)
    : path_{std::move(path)}, store_{std::move(store)}, spans_{std::move(spans)}, query_{query} {}

bool RunFile::advance(SQLite::Database& database) {
  if (!file_) {
    begin(database);
    return true;
  }
  while (const auto segment = segments_.next()) add(*segment);
  if (at_end_) {
    finish();
    return false;
  }
  SegmentPage page = read_segments(database, spans_, after_, kSliceSamples, query_.channels);
  after_ = page.next;
  at_end_ = !after_;
  segments_.give(std::move(page));
  return true;
}

void RunFile::begin(SQLite::Database& database) {
  file_ = std::make_unique<SQLite::Database>(path_.string(),
                                             SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_URI);
  file_->exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF");
  file_->exec(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", kApplicationId + 1, kRunFileVersion));
  file_->exec(kTables);
  copy_tables();
  file_->exec("BEGIN");
  SQLite::Statement insert{*file_, "INSERT INTO gap VALUES (?,?,?,?,?)"};
  for (const Gap& gap : read_gaps(database, spans_)) {
    execute(insert, std::to_string(gap.boot_id), gap.first_seq, gap.last_seq, gap.cause, gap.noticed_at_us);
  }
  insert_ = std::make_unique<SQLite::Statement>(*file_, kInsert);
}

void RunFile::copy_tables() {
  {
    SQLite::Statement attach{*file_, "ATTACH ? AS store"};
    execute(attach, store_);
  }
  file_->exec(fmt::format(kCopies, query_.run));
  file_->exec("DETACH store");
}

void RunFile::add(const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  const SampleContext& context = segment.context;
  const std::string boot_id = std::to_string(exported.part->boot_id);
  const std::string emergency_id = std::to_string(context.emergency_id);
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    const Sample& sample = segment.samples[index];
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    execute(*insert_, exported.part->span, boot_id, signed_seq(segment.first_seq + index), robot_time_us,
            static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us, segment.clock_uncertainty_us,
            segment.first_received_at_us, segment.received_at_us,  //
            sample.position_m, sample.velocity_m_s, sample.acceleration_m_s2, sample.duty, sample.impedance_mv,
            sample.reference_m, protocol::text(context.mode), protocol::text(context.sub_state), context.setpoint_m,
            context.disturbance_m, context.position_sd_m, context.controller_id, emergency_id,
            protocol::text(context.emergency_cause), context.flags, signed_seq(index == 0 ? exported.gap_before : 0));
  }
}

void RunFile::finish() {
  insert_.reset();
  file_->exec("COMMIT");
  file_.reset();
  const int file = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) throw std::runtime_error{"cannot open " + path_.string()};
  const int synced = ::fsync(file);
  ::close(file);
  if (synced != 0) throw std::runtime_error{"cannot sync " + path_.string()};
}

}  // namespace server
