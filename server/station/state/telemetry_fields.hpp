// The table of the fields of telemetry: those of each sample, and those of a batch of samples.
//
// A field is a member of Sample or SampleContext and a row of kSampleFields or kBatchFields. Everything that copies,
// stores, reads, hashes or exports samples visits the rows, so a new field needs no line there. The loops have constant
// bounds and the rows are constants: the compiler makes the code that one would write field by field.
//
//   struct SampleContext { …; std::optional<float> supply_v; };
//   BatchField<std::optional<float>>{.name = "supply_v", .member = &SampleContext::supply_v,
//                                    .wire = &protocol::Telemetry::supply_v, .since_schema = 8, .since_digest = 3}
//
// `name` is that of robot.proto, with its unit, and the same in SQL, CSV, MAT and JSON. A number that is not finite, or
// that the robot left out, is NULL in SQL, null in JSON, NaN in MAT and an empty field of a CSV. What has no row here
// places the samples in time (seq, robot time, period). Rows are only ever added, at the end.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "protocol/messages.hpp"

namespace server::station {

// What changes with each sample: binary32 each.
struct Sample {
  float position_m = 0;
  float velocity_m_s = 0;
  float acceleration_m_s2 = 0;
  float duty = 0;  // in [-1, 1]
  float impedance_mv = 0;
  float reference_m = 0;
  bool operator==(const Sample&) const = default;
};

// What a telemetry frame says once for all its samples; a change of any of it begins a new segment in the store.
struct SampleContext {
  std::uint32_t period_us = 0;
  protocol::Mode mode = rheonaut_MODE_UNSPECIFIED;
  protocol::SubState sub_state = rheonaut_SUB_STATE_NONE;
  std::optional<float> setpoint_m;
  std::optional<float> disturbance_m = 0.0F;  // as in setpoint_m and position_sd_m, none stands for no finite number
  std::optional<float> position_sd_m = 0.0F;
  std::uint32_t controller_id = 0;
  std::uint64_t emergency_id = 0;  // 0: not latched
  protocol::EmergencyCause emergency_cause = rheonaut_EMERGENCY_CAUSE_NONE;
  std::uint32_t flags = 0;  // TelemetryFlag
  bool operator==(const SampleContext&) const = default;
};

struct SampleField {
  const char* name;
  float Sample::* member;
  float (protocol::Telemetry::*wire)[protocol::kMaxSamplesPerFrame];
  std::int64_t since_schema = 1;  // version; in a database of an earlier one the field is NULL
  int since_digest = 1;           // format; digests of an earlier one do not contain the field
};

// By the type of the member.
enum class FieldKind : std::uint8_t {
  number,      // std::optional<float>: none is no finite number
  enumerator,  // of the protocol; protocol::text() gives its text
  count,       // std::uint32_t
  id,          // std::uint64_t, random; 0: none
};
template <class Value>
constexpr FieldKind kind_of_member() {
  if (std::is_enum_v<Value>) return FieldKind::enumerator;
  if (std::is_same_v<Value, std::optional<float>>) return FieldKind::number;
  return std::is_same_v<Value, std::uint64_t> ? FieldKind::id : FieldKind::count;
}

template <class Value>
struct BatchField {
  static constexpr FieldKind kKind = kind_of_member<Value>();
  static_assert(kKind != FieldKind::count || std::is_same_v<Value, std::uint32_t>);
  using Wire = std::conditional_t<kKind == FieldKind::number, float, Value>;

  const char* name;
  Value SampleContext::* member;
  Wire protocol::Telemetry::* wire;
  bool protocol::Telemetry::* has = nullptr;  // null: `optional` does not stand before it in robot.proto
  bool is_in_live_samples = true;             // false: pages of /live get it with the robot's state alone
  std::int64_t since_schema = 1;              // as in SampleField
  int since_digest = 1;
};

inline constexpr std::array kSampleFields{
    SampleField{"position_m", &Sample::position_m, &protocol::Telemetry::position_m},
    SampleField{"velocity_m_s", &Sample::velocity_m_s, &protocol::Telemetry::velocity_m_s},
    SampleField{"acceleration_m_s2", &Sample::acceleration_m_s2, &protocol::Telemetry::acceleration_m_s2},
    SampleField{"duty", &Sample::duty, &protocol::Telemetry::duty},
    SampleField{"impedance_mv", &Sample::impedance_mv, &protocol::Telemetry::impedance_mv},
    SampleField{"reference_m", &Sample::reference_m, &protocol::Telemetry::reference_m},
};

inline constexpr std::tuple kBatchFields{
    BatchField<protocol::Mode>{"mode", &SampleContext::mode, &protocol::Telemetry::mode},
    BatchField<protocol::SubState>{"sub_state", &SampleContext::sub_state, &protocol::Telemetry::sub_state},
    BatchField<std::optional<float>>{"setpoint_m", &SampleContext::setpoint_m, &protocol::Telemetry::setpoint_m,
                                     &protocol::Telemetry::has_setpoint_m},
    BatchField<std::optional<float>>{"disturbance_m", &SampleContext::disturbance_m,
                                     &protocol::Telemetry::disturbance_m},
    BatchField<std::optional<float>>{"position_sd_m", &SampleContext::position_sd_m,
                                     &protocol::Telemetry::position_sd_m},
    BatchField<std::uint32_t>{.name = "controller_id",
                              .member = &SampleContext::controller_id,
                              .wire = &protocol::Telemetry::controller_id,
                              .is_in_live_samples = false},
    BatchField<std::uint64_t>{"emergency_id", &SampleContext::emergency_id, &protocol::Telemetry::emergency_id},
    BatchField<protocol::EmergencyCause>{.name = "emergency_cause",
                                         .member = &SampleContext::emergency_cause,
                                         .wire = &protocol::Telemetry::emergency_cause,
                                         .is_in_live_samples = false},
    BatchField<std::uint32_t>{"flags", &SampleContext::flags, &protocol::Telemetry::flags},
};

inline constexpr std::size_t kSampleFieldCount = kSampleFields.size();
inline constexpr std::size_t kBatchFieldCount = std::tuple_size_v<decltype(kBatchFields)>;

// Calls visit(field) for each row, in the order of the table.
template <class Visit>
constexpr void for_each_sample_field(Visit&& visit) {
  [&]<std::size_t... index>(std::index_sequence<index...>) {
    (visit(kSampleFields[index]), ...);
  }(std::make_index_sequence<kSampleFieldCount>{});
}
template <class Visit>
constexpr void for_each_batch_field(Visit&& visit) {
  std::apply([&](const auto&... field) { (visit(field), ...); }, kBatchFields);
}
// Only for the rows of one kind.
template <FieldKind kind, class Visit>
constexpr void for_each_batch_field_of(Visit&& visit) {
  for_each_batch_field([&]<class Value>(const BatchField<Value>& field) {
    if constexpr (BatchField<Value>::kKind == kind) visit(field);
  });
}

// The format of a digest that contains every row that asks for one.
constexpr int newest_digest_format() {
  int newest = 2;  // which brought the numbers of enumerators that a station does not know
  for_each_sample_field([&](const auto& field) { newest = std::max(newest, field.since_digest); });
  for_each_batch_field([&](const auto& field) { newest = std::max(newest, field.since_digest); });
  return newest;
}

// An enumerator as its text, any other value of a field as it is.
template <class Value>
auto text_or_value(const Value& value) {
  if constexpr (std::is_enum_v<Value>) {
    return protocol::text(value);
  } else {
    return value;
  }
}

inline float or_nan(const std::optional<float>& value) {
  return value.value_or(std::numeric_limits<float>::quiet_NaN());
}

// The values of a sample by row.
inline std::array<float, kSampleFieldCount> values_of(const Sample& sample) {
  std::array<float, kSampleFieldCount> values;
  std::size_t index = 0;
  for_each_sample_field([&](const SampleField& field) { values[index++] = sample.*field.member; });
  return values;
}

// What a frame of telemetry says, with none for what is not finite.
SampleContext context_of(const protocol::Telemetry& telemetry);
void copy_samples(const protocol::Telemetry& telemetry, std::vector<Sample>& into);

}  // namespace server::station
