// What the samples of a segment share is formatted once.
#include "server/storage/export/mcap/mcap_writer.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_text.hpp"
#include "base/number_text.hpp"
#include "base/version.hpp"
#include "server/station/state/unknown_values.hpp"
#include "server/storage/export/run_facts.hpp"

namespace server::storage {

using base::append_float;
using base::append_number;
namespace {

constexpr std::size_t kMcapPageSamples = 4'000;

constexpr TableChannel kTableChannels[] = {
    {"/event", "rheonaut.Event", "event", "received_at_us", "coalesce(robot_time_us, received_at_us)"},
    {"/command", "rheonaut.Command", "command", "submitted_at_us", "submitted_at_us"},
    {"/gap", "rheonaut.Gap", "gap", "noticed_at_us", "noticed_at_us"},
    {"/marker", "rheonaut.Marker", "marker", "made_at_us", "made_at_us"},
};

// Those that place a sample, and those of every export.
constexpr const char* kIntegers[] = {
    "span",           "seq",        "robot_time_us", "utc_us", "clock_uncertainty_us", "first_received_at_us",
    "received_at_us", "gap_before", "gap_after"};

template <station::FieldKind kind>
constexpr const char* json_type_of() {
  if (kind == station::FieldKind::number) return "number";
  return kind == station::FieldKind::count ? "integer" : "string";
}

void append_member(std::string& out, const char* name, float value) {
  if (!std::isfinite(value)) return;
  out += ",\"";
  out += name;
  out += "\":";
  append_float(out, value, "");
}

// What follows the channels, up to gap_before.
std::string shared_members(const Segment& segment) {
  std::string out;
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    using station::FieldKind;
    const Value& value = segment.context.*field.member;
    if constexpr (station::BatchField<Value>::kKind == FieldKind::number) {
      append_member(out, field.name, station::or_nan(value));
    } else if constexpr (station::BatchField<Value>::kKind == FieldKind::count) {
      out += fmt::format(",\"{}\":{}", field.name, value);
    } else {
      out += fmt::format(",\"{}\":\"{}\"", field.name, station::text_or_value(value));
    }
  });
  out += fmt::format(",\"clock_uncertainty_us\":{},\"first_received_at_us\":{},\"received_at_us\":{}",
                     segment.clock_uncertainty_us, segment.first_received_at_us, segment.received_at_us);
  return out;
}

}  // namespace

McapWriter::McapWriter(const std::filesystem::path& path, const std::string& store, std::vector<RecordedSpan> spans,
                       ExportQuery query)
    : file_{path, std::string{"rheonaut "} + base::version()},
      spans_{std::move(spans)},
      query_{query},
      beside_{std::make_unique<SQLite::Database>("", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_URI)} {
  beside_->exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF");
  copy_.emplace(*beside_, store, query.run);
  telemetry_ = file_.add_channel("/telemetry", "rheonaut.Telemetry", telemetry_schema());
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

std::string McapWriter::telemetry_schema() const {
  nlohmann::json properties = nlohmann::json::object();
  const auto add = [&](const char* name, const char* type) { properties[name] = {{"type", type}}; };
  add("boot_id", "string");
  for (const char* name : kIntegers) add(name, "integer");
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    if (query_.channels[channel]) add(text(static_cast<Channel>(channel)), "number");
  }
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    add(field.name, json_type_of<station::BatchField<Value>::kKind>());
  });
  add("unknown_values", "string");
  return base::dump({{"type", "object"}, {"properties", properties}});
}

void McapWriter::write(const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  const std::string beginning =
      fmt::format("{{\"span\":{},\"boot_id\":\"{}\",\"seq\":", exported.part->span, exported.part->boot_id);
  const std::string shared = shared_members(segment) + ",\"gap_before\":";
  const auto unknown = unknown_values(segment.context);
  const std::string end = unknown ? fmt::format(",\"unknown_values\":{}}}", base::dump(*unknown)) : "}";
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    const std::uint64_t seq = segment.first_seq + index;
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    const std::int64_t utc_us = static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us;
    std::string& out =
        file_.begin_message({telemetry_, static_cast<std::uint32_t>(seq), nanoseconds(utc_us), robot_time_us * 1000});
    out += beginning;
    append_number(out, seq);
    out += ",\"robot_time_us\":";
    append_number(out, robot_time_us);
    out += ",\"utc_us\":";
    append_number(out, utc_us);
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      if (!query_.channels[channel]) continue;
      append_member(out, text(static_cast<Channel>(channel)), segment.samples[index].*kSampleMembers[channel]);
    }
    out += shared;
    append_number(out, index == 0 ? exported.gap_before : 0);
    out += ",\"gap_after\":";
    append_number(out, index + 1 == segment.samples.size() ? exported.gap_after : 0);
    out += end;
    file_.end_message();
  }
}

}  // namespace server::storage
