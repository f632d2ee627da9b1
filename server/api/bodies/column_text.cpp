// JSON by std::to_chars; what a segment's samples share is written once.
#include "server/api/bodies/column_text.hpp"

#include <fmt/format.h>

#include "base/number_text.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/station/state/unknown_values.hpp"

namespace server::api {

using base::append_float;
using base::append_number;
namespace {

void append_value(std::string& out, const std::optional<float>& value) {
  append_float(out, station::or_nan(value), "null");
}
void append_value(std::string& out, std::uint32_t value) { append_number(out, value); }
void append_value(std::string& out, std::uint64_t id) { out += id == 0 ? "null" : fmt::format(R"("{}")", id); }
template <class Enumerator>
void append_value(std::string& out, Enumerator value) {
  out += fmt::format(R"("{}")", protocol::text(value));
}

// What a sample's object ends with.
std::string shared_text(const storage::Segment& segment) {
  const bool is_received = segment.received_at_us != 0;
  std::string out = fmt::format(R"(,"clock_uncertainty_us":{},"first_received_at_us":{},"received_at_us":{})",
                                segment.clock_uncertainty_us, segment.first_received_at_us,
                                is_received ? std::to_string(segment.received_at_us) : "null");
  station::for_each_batch_field([&](const auto& field) {
    out += fmt::format(R"(,"{}":)", field.name);
    append_value(out, segment.context.*field.member);
  });
  out += fmt::format(R"(,"unknown_values":{}}})", unknown_values(segment.context).value_or("null"));
  return out;
}

void append_segment(std::string& out, const storage::SpanSegment& part) {
  const storage::Segment& segment = part.segment;
  const std::string beginning = fmt::format(R"({{"span":{},"boot_id":"{}","seq":)", part.span, part.boot_id);
  const std::string end = shared_text(segment);
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    if (out.back() != '[') out += ',';
    out += beginning;
    append_number(out, segment.first_seq + index);
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    out += R"(,"robot_time_us":)";
    append_number(out, robot_time_us);
    out += R"(,"utc_us":)";
    append_number(out, static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us);
    for (std::size_t channel = 0; channel < storage::kChannels; ++channel) {
      out += ",\"";
      out += text(static_cast<storage::Channel>(channel));
      out += "\":";
      append_float(out, segment.samples[index].*storage::kSampleMembers[channel], "null");
    }
    out += end;
  }
}

void append(std::string& out, float value) { append_float(out, value, "null"); }
template <std::integral Number>
void append(std::string& out, Number value) {
  append_number(out, value);
}

// "name":[1,2,3]
template <class Number>
void append_column(std::string& out, const char* name, const std::vector<Number>& values) {
  out += '"';
  out += name;
  out += "\":[";
  for (const Number value : values) {
    if (out.back() != '[') out += ',';
    append(out, value);
  }
  out += ']';
}

std::string next_text(const std::optional<storage::SampleCursor>& next) {
  return next ? '"' + cursor_text(*next) + '"' : "null";
}

// "gaps":[...]
void append_gaps(std::string& out, const std::vector<storage::Gap>& gaps) {
  out += R"("gaps":[)";
  for (const storage::Gap& gap : gaps) {
    if (out.back() != '[') out += ',';
    out += fmt::format(R"({{"robot_id":{},"boot_id":"{}","first_seq":{},"last_seq":{},"cause":{},"noticed_at_us":{}}})",
                       base::dump(gap.robot_id), gap.boot_id, gap.first_seq, gap.last_seq, base::dump(gap.cause),
                       gap.noticed_at_us);
  }
  out += ']';
}

}  // namespace

std::string page_text(const storage::SegmentPage& page) {
  std::string out = R"({"samples":[)";
  for (const storage::SpanSegment& part : page.segments) append_segment(out, part);
  out += R"(],"next":)" + next_text(page.next) + '}';
  return out;
}

std::string overview_text(const storage::Overview& overview, storage::OverviewChannels channels) {
  const storage::OverviewColumns& columns = overview.columns;
  std::string out = columns.from_segments ? R"({"source":"segments",)" : R"({"source":"rows",)";
  append_column(out, "first_utc_us", columns.first_utc_us);
  out += ',';
  append_column(out, "last_utc_us", columns.last_utc_us);
  out += ',';
  append_column(out, "samples", columns.samples);
  for (std::size_t channel = 0; channel < storage::kOverviewChannels; ++channel) {
    if (!channels[channel]) continue;
    out += fmt::format(R"(,"{}":{{)", storage::overview_name(channel));
    append_column(out, "min", columns.min[channel]);
    out += ',';
    append_column(out, "max", columns.max[channel]);
    out += '}';
  }
  out += ',';
  append_gaps(out, overview.gaps.gaps);
  out += R"(,"gaps_next":)" + next_text(overview.gaps.next) + '}';
  return out;
}

std::string absences_text(const storage::AbsencePage& page) {
  std::string out = "{";
  append_gaps(out, page.gaps);
  out += R"(,"missing":[)";
  for (const storage::MissingRange& range : page.missing) {
    if (out.back() != '[') out += ',';
    out += fmt::format(R"({{"boot_id":"{}","first_seq":{},"last_seq":{}}})", range.boot_id, range.first_seq,
                       range.last_seq);
  }
  out += R"(],"next":)" + next_text(page.next) + '}';
  return out;
}

}  // namespace server::api
