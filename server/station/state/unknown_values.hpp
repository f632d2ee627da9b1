// Enumerators that a newer firmware sends: their text is "unknown", and their numbers are kept beside it.
//
//   {"mode":17,"sub_state":9}   the number of each field whose enumerator this version does not know
//
// The same text stands in the database, in CSV and in JSON, where it is an object; there is none when all are known.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "protocol/messages.hpp"
#include "server/station/state/telemetry_fields.hpp"

namespace server::station {

// Of an enumerator that a version before schema 7 stored: of those it kept the text alone.
inline constexpr std::int32_t kNumberNotKept = std::numeric_limits<std::int32_t>::min();

template <class Enumerator>
std::int32_t number_of(Enumerator value) {
  return static_cast<std::int32_t>(value);
}

template <class Enumerator>
bool is_unknown(Enumerator value) {
  return number_of(value) != 0 && std::string_view{protocol::text(value)} == "unknown";  // 0 always has a meaning
}

class UnknownValues {
 public:
  template <class Enumerator>
  UnknownValues& add(const char* field, Enumerator value) {
    if (is_unknown(value) && number_of(value) != kNumberNotKept) {
      text_ += fmt::format("{}\"{}\":{}", text_.empty() ? '{' : ',', field, number_of(value));
    }
    return *this;
  }
  UnknownValues& add_fields_of(const SampleContext& context) {
    for_each_batch_field_of<FieldKind::enumerator>([&](const auto& field) { add(field.name, context.*field.member); });
    return *this;
  }
  std::optional<std::string> text() const { return text_.empty() ? std::nullopt : std::optional{text_ + '}'}; }

 private:
  std::string text_;
};

inline std::optional<std::string> unknown_values(const SampleContext& context) {
  return UnknownValues{}.add_fields_of(context).text();
}

// "busy", or "unknown_17" where only the text is kept.
template <class Enumerator>
std::string text_or_number(Enumerator value) {
  return is_unknown(value) ? fmt::format("unknown_{}", number_of(value)) : protocol::text(value);
}

}  // namespace server::station
