// What the samples of a segment share is formatted once.
#include "server/storage/export/mcap/mcap_writer.hpp"

#include <iterator>

#include "base/version.hpp"
#include "server/station/state/telemetry_message.hpp"
#include "server/storage/export/run_facts.hpp"

namespace server::storage {

namespace {

constexpr std::size_t kMcapPageSamples = 4'000;

constexpr TableChannel kTableChannels[] = {
    {"/event", "rheonaut.Event", "event", "received_at_us", "coalesce(robot_time_us, received_at_us)"},
    {"/command", "rheonaut.Command", "command", "submitted_at_us", "submitted_at_us"},
    {"/gap", "rheonaut.Gap", "gap", "noticed_at_us", "noticed_at_us"},
    {"/marker", "rheonaut.Marker", "marker", "made_at_us", "made_at_us"},
};

}  // namespace

McapWriter::McapWriter(const std::filesystem::path& path, const std::string& store, std::vector<RecordedSpan> spans,
                       ExportQuery query)
    : file_{path, std::string{"rheonaut "} + base::version()},
      spans_{std::move(spans)},
      query_{query},
      beside_{std::make_unique<SQLite::Database>("", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_URI)} {
  beside_->exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF");
  copy_.emplace(*beside_, store, query.run);
  telemetry_ =
      file_.add_channel("/telemetry", station::kTelemetrySchemaName, station::telemetry_schema(query_.channels));
}

bool McapWriter::advance(SQLite::Database& database) {
  if (copy_) {
    if (!copy_->advance(database, spans_)) copy_.reset();
    return true;
  }
  if (beside_) {
    if (!write_tables()) beside_.reset();
    return true;
  }
  if (write_samples(database)) return true;
  Facts facts = facts_of_run(database, query_.run);
  facts.emplace_back("program", std::string{"rheonaut "} + base::version());
  file_.add_metadata("rheonaut.run", facts);
  file_.finish();
  return false;
}

bool McapWriter::write_tables() {
  if (!table_) {
    if (tables_written_ == std::size(kTableChannels)) return false;
    table_.emplace(*beside_, file_, kTableChannels[tables_written_]);
  }
  if (!table_->advance()) {
    table_.reset();
    ++tables_written_;
  }
  return true;
}

bool McapWriter::write_samples(SQLite::Database& database) {
  while (const auto segment = segments_.next()) write(*segment);
  if (at_end_) return false;
  SegmentPage page = read_segments(database, spans_, after_, kMcapPageSamples, query_.channels);
  after_ = page.next;
  at_end_ = !after_;
  segments_.give(std::move(page));
  return true;
}

void McapWriter::write(const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  const station::TelemetryMessages messages{
      exported.part->span,
      exported.part->boot_id,
      segment.context,
      {segment.clock_uncertainty_us, segment.first_received_at_us, segment.received_at_us},
      query_.channels};
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    const std::uint64_t seq = segment.first_seq + index;
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    const std::int64_t utc_us = static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us;
    std::string& out =
        file_.begin_message({telemetry_, static_cast<std::uint32_t>(seq), nanoseconds(utc_us), robot_time_us * 1000});
    const station::SampleInRun in_run{exported.since_us(robot_time_us), index == 0 ? exported.gap_before : 0,
                                      index + 1 == segment.samples.size() ? exported.gap_after : 0,
                                      index == 0 ? exported.missed_before : 0};
    messages.append(out, {seq, robot_time_us, utc_us}, segment.samples[index], in_run);
    file_.end_message();
  }
}

}  // namespace server::storage
