// Lines by std::to_chars; what a segment's samples share is formatted once.
#include "server/storage/export/csv_writer.hpp"

#include <fmt/format.h>

#include <chrono>
#include <limits>

#include "base/number_text.hpp"
#include "server/station/state/unknown_values.hpp"

namespace server::storage {

using base::append_float;
using base::append_number;
using base::append_seconds;
namespace {

constexpr std::size_t kCsvPageSamples = 2'000;
constexpr std::size_t kPieceBytes = 384 * 1024;  // of a grid, whose gaps may be long
constexpr std::int64_t kSecondUs = 1'000'000;
constexpr std::size_t kBeforeTimes = 4;  // fields of a batch before the times of receipt
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

// Empty for none.
std::string quoted(const std::optional<std::string>& text) {
  if (!text) return {};
  std::string out = "\"";
  for (const char c : *text) out += c == '"' ? "\"\"" : std::string{c};
  return out + '"';
}

}  // namespace

void UtcText::append(std::string& out, std::int64_t utc_us) {
  const std::int64_t second = (utc_us >= 0 ? utc_us : utc_us - kSecondUs + 1) / kSecondUs;
  if (second != second_ || beginning_.empty()) {
    const std::chrono::sys_seconds time{std::chrono::seconds{second}};
    const auto day = std::chrono::floor<std::chrono::days>(time);
    const std::chrono::year_month_day date{day};
    const std::chrono::hh_mm_ss clock{time - day};
    beginning_ = fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.", static_cast<int>(date.year()),
                             static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                             clock.hours().count(), clock.minutes().count(), clock.seconds().count());
    second_ = second;
  }
  out += beginning_;
  base::append_micros(out, utc_us - second * kSecondUs);
  out += 'Z';
}

CsvWriter::CsvWriter(std::vector<RecordedSpan> spans, ExportQuery query) : spans_{std::move(spans)}, query_{query} {
  if (query.grid_us) grid_.emplace(*query.grid_us);
}

std::optional<std::string> CsvWriter::next(SQLite::Database& database) {
  std::string out = begun_ ? "" : header();
  begun_ = true;
  out.reserve(kPieceBytes + kPieceBytes / 4);
  append_rows(out);
  if (out.size() >= kPieceBytes) return out;
  if (at_end_) return out.empty() ? std::nullopt : std::optional{std::move(out)};
  SegmentPage page = read_segments(database, spans_, after_, kCsvPageSamples, query_.channels);
  after_ = page.next;
  at_end_ = !after_;
  grid_ ? grid_->give(std::move(page)) : segments_.give(std::move(page));
  append_rows(out);
  return out;  // empty where the steps of the grid are longer than a page
}

// Of the page at hand.
void CsvWriter::append_rows(std::string& out) {
  while (out.size() < kPieceBytes) {
    if (grid_) {
      const auto row = grid_->next();
      if (!row) return;
      append(out, *row);
    } else {
      const auto segment = segments_.next();
      if (!segment) return;
      append(out, *segment);
    }
  }
}

std::string CsvWriter::header() const {
  std::string out = grid_ ? "span,t_s,utc" : "span,boot_id,seq,robot_time_us,t_s,utc";
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    if (query_.channels[channel]) out += fmt::format(",{}", text(static_cast<Channel>(channel)));
  }
  if (grid_) return out + ",setpoint_m,mode,gap\n";
  std::size_t number = 0;
  station::for_each_batch_field([&](const auto& field) {
    if (number++ == kBeforeTimes) out += ",clock_uncertainty_us,first_received_at_us,received_at_us";
    out += fmt::format(",{}", field.name);
  });
  return out + ",gap_before,gap_after,unknown_values,missed_ticks_before\n";
}

// What follows the channels, up to gap_before.
std::string CsvWriter::shared_text(const Segment& segment) const {
  std::string out;
  std::size_t number = 0;
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    if (number++ == kBeforeTimes) {
      const bool is_received = segment.received_at_us != 0;
      out += fmt::format(",{},{},{}", segment.clock_uncertainty_us, segment.first_received_at_us,
                         is_received ? std::to_string(segment.received_at_us) : "");
    }
    out += ',';
    const Value& value = segment.context.*field.member;
    if constexpr (station::BatchField<Value>::kKind == station::FieldKind::number) {
      append_float(out, station::or_nan(value), "");
    } else {
      out += fmt::format("{}", station::text_or_value(value));
    }
  });
  return out + ',';
}

void CsvWriter::append(std::string& out, const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  const std::string beginning = fmt::format("{},{},", exported.part->span, exported.part->boot_id);
  const std::string end = shared_text(segment);
  const std::string unknown = ',' + quoted(unknown_values(segment.context)) + ',';
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    out += beginning;
    append_number(out, segment.first_seq + index);
    out += ',';
    append_number(out, robot_time_us);
    out += ',';
    append_seconds(out, exported.since_us(robot_time_us));
    out += ',';
    utc_.append(out, static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us);
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      if (!query_.channels[channel]) continue;
      out += ',';
      append_float(out, segment.samples[index].*kSampleMembers[channel], "");
    }
    out += end;
    append_number(out, index == 0 ? exported.gap_before : 0);
    out += ',';
    append_number(out, index + 1 == segment.samples.size() ? exported.gap_after : 0);
    out += unknown;
    append_number(out, index == 0 ? exported.missed_before : 0);
    out += '\n';
  }
}

void CsvWriter::append(std::string& out, const GridRow& row) {
  append_number(out, row.span);
  out += ',';
  append_seconds(out, row.since_us);
  out += ',';
  utc_.append(out, row.utc_us);
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    if (!query_.channels[channel]) continue;
    out += ',';
    append_float(out, row.sample != nullptr ? row.sample->*kSampleMembers[channel] : kNone, "");
  }
  out += ',';
  if (row.sample == nullptr) {
    out += ",,1\n";
    return;
  }
  append_float(out, station::or_nan(row.context->setpoint_m), "");
  out += fmt::format(",{},0\n", protocol::text(row.context->mode));
}

}  // namespace server::storage
