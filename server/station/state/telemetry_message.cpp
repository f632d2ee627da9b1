// The schema, and what is written once for many samples.
#include "server/station/state/telemetry_message.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_text.hpp"
#include "base/number_text.hpp"
#include "server/station/state/unknown_values.hpp"

namespace server::station {

using base::append_number;

namespace {

// Those that place a sample, and those of every message.
constexpr const char* kIntegers[] = {"span",
                                     "seq",
                                     "robot_time_us",
                                     "utc_us",
                                     "clock_uncertainty_us",
                                     "first_received_at_us",
                                     "received_at_us",
                                     "gap_before",
                                     "gap_after",
                                     "missed_ticks_before"};

constexpr std::pair<const char*, const char*> kDescriptions[] = {
    {"position_m", "believed position plus disturbance_m: the robot's estimate, ± position_sd_m"},
    {"position_sd_m", "± of position_m, one standard deviation; none: not known"},
    {"t_s", "seconds since the first sample of the span, on the robot's clock"},
    {"utc_us", "station's estimate of UTC, ± clock_uncertainty_us"},
    {"clock_uncertainty_us", "± of utc_us, at most; -1: no estimate yet"}};

template <FieldKind kind>
constexpr const char* json_type_of() {
  if (kind == FieldKind::number) return "number";
  return kind == FieldKind::count ? "integer" : "string";
}

void append_member(std::string& out, const char* name, float value) {
  if (!std::isfinite(value)) return;
  out += ",\"";
  out += name;
  out += "\":";
  base::append_float(out, value, "");
}

}  // namespace

std::string telemetry_schema(const ChosenFields& chosen) {
  nlohmann::json properties = nlohmann::json::object();
  const auto add = [&](const char* name, const char* type) { properties[name] = {{"type", type}}; };
  add("boot_id", "string");
  for (const char* name : kIntegers) add(name, "integer");
  add("t_s", "number");
  for (std::size_t row = 0; row < kSampleFieldCount; ++row) {
    if (chosen[row]) add(kSampleFields[row].name, "number");
  }
  for_each_batch_field(
      [&]<class Value>(const BatchField<Value>& field) { add(field.name, json_type_of<BatchField<Value>::kKind>()); });
  add("unknown_values", "string");
  for (const auto& [name, text] : kDescriptions) {
    if (properties.contains(name)) properties[name]["description"] = text;
  }
  return base::dump({{"type", "object"}, {"properties", properties}});
}

TelemetryMessages::TelemetryMessages(std::optional<std::uint32_t> span, std::uint64_t boot_id,
                                     const SampleContext& context, const ReceptionTimes& times,
                                     const ChosenFields& chosen)
    : chosen_{chosen}, beginning_{"{"}, end_{"}"} {
  if (span) beginning_ += fmt::format("\"span\":{},", *span);
  beginning_ += fmt::format("\"boot_id\":\"{}\",\"seq\":", boot_id);
  for_each_batch_field([&]<class Value>(const BatchField<Value>& field) {
    const Value& value = context.*field.member;
    if constexpr (BatchField<Value>::kKind == FieldKind::number) {
      append_member(shared_, field.name, or_nan(value));
    } else if constexpr (BatchField<Value>::kKind == FieldKind::count) {
      shared_ += fmt::format(",\"{}\":{}", field.name, value);
    } else {
      shared_ += fmt::format(",\"{}\":\"{}\"", field.name, text_or_value(value));
    }
  });
  shared_ += fmt::format(",\"clock_uncertainty_us\":{},\"first_received_at_us\":{},\"received_at_us\":{}",
                         times.clock_uncertainty_us, times.first_received_at_us, times.received_at_us);
  const auto unknown = unknown_values(context);
  if (unknown) end_ = fmt::format(",\"unknown_values\":{}}}", base::dump(*unknown));
}

void TelemetryMessages::append(std::string& out, const SamplePlace& place, const Sample& sample,
                               std::optional<SampleInRun> in_run) const {
  out += beginning_;
  append_number(out, place.seq);
  out += ",\"robot_time_us\":";
  append_number(out, place.robot_time_us);
  if (in_run) {
    out += ",\"t_s\":";
    base::append_seconds(out, in_run->since_us);
  }
  out += ",\"utc_us\":";
  append_number(out, place.utc_us);
  for (std::size_t row = 0; row < kSampleFieldCount; ++row) {
    if (chosen_[row]) append_member(out, kSampleFields[row].name, sample.*kSampleFields[row].member);
  }
  out += shared_;
  if (in_run) {
    out += ",\"gap_before\":";
    append_number(out, in_run->gap_before);
    out += ",\"gap_after\":";
    append_number(out, in_run->gap_after);
    out += ",\"missed_ticks_before\":";
    append_number(out, in_run->missed_ticks_before);
  }
  out += end_;
}

}  // namespace server::station
