// The table from error codes to statuses; the strict reading of a JSON object; runs and gaps as JSON.
#include "server/api/bodies/json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "base/nesting.hpp"

namespace server::api {

using nlohmann::json;

namespace {

constexpr std::size_t kMaxQuotedValue = 60;

std::string quote(const json& value) {
  std::string text = base::dump(value);
  if (text.size() > kMaxQuotedValue) text = text.substr(0, kMaxQuotedValue) + "…";
  return text;
}

std::unexpected<Error> wrong_type(const char* name, const char* wanted, const json& value) {
  return fail(ErrorCode::bad_request, fmt::format("{} = {} is not {}", name, quote(value), wanted), "wrong_type");
}

std::unexpected<Error> missing(const char* name) {
  return fail(ErrorCode::bad_request, fmt::format("{} is missing", name), "missing_member");
}

// As JSON Schema has it: 2000.0 is one. NaN and the infinities are no JSON.
bool is_integer(const json& value) {
  if (!value.is_number_float()) return value.is_number_integer();
  const auto number = value.get<double>();
  return std::trunc(number) == number;
}

// The value of an integer; none where it is beyond 64 bits, or is a number with a point beyond those that a double
// holds exactly.
std::optional<std::int64_t> integer_of(const json& value) {
  constexpr double kMostExact = 9'007'199'254'740'992;
  if (value.is_number_float()) {
    const auto number = value.get<double>();
    return std::abs(number) <= kMostExact ? std::optional{static_cast<std::int64_t>(number)} : std::nullopt;
  }
  if (value.is_number_unsigned() && value.get<std::uint64_t>() > std::uint64_t{INT64_MAX}) return std::nullopt;
  return value.get<std::int64_t>();
}

// Finds the name of a member that comes twice in an object: nlohmann's parser keeps the last one and forgets the
// others.
class RepeatedMembers {
 public:
  bool operator()(int, json::parse_event_t event, const json& parsed) {
    using Event = json::parse_event_t;
    if (event == Event::object_start) names_.emplace_back();
    if (event == Event::object_end) names_.pop_back();
    if (event == Event::key && !names_.back().insert(parsed.get<std::string>()).second && first_.empty())
      first_ = quote(parsed);
    return true;
  }
  const std::string& first() const { return first_; }  // quoted; empty: there is none

 private:
  std::vector<std::set<std::string>> names_;  // of the objects that are open
  std::string first_;
};

}  // namespace

Result<Members> Members::parse(const std::string& text, std::initializer_list<const char*> known) {
  if (base::is_json_deeper(text, kMaxJsonDepth)) {
    return fail(ErrorCode::bad_request, fmt::format("the body is nested deeper than {} levels", kMaxJsonDepth),
                "malformed_json");
  }
  RepeatedMembers repeated;
  json value = json::parse(text, std::ref(repeated), false);
  if (value.is_discarded()) {
    return fail(ErrorCode::bad_request, "the body is not valid JSON (JSON has no NaN and no Infinity)",
                "malformed_json");
  }
  if (!value.is_object()) return fail(ErrorCode::bad_request, "the body is not a JSON object", "malformed_json");
  Members members{std::move(value)};
  members.repeated_ = repeated.first();
  if (known.size() > 0) {
    if (auto checked = members.only(known); !checked) return std::unexpected{checked.error()};
  }
  return members;
}

Result<void> Members::only(std::initializer_list<const char*> known) const {
  if (!repeated_.empty()) {
    return fail(ErrorCode::bad_request, fmt::format("{} is given twice in one object", repeated_), "repeated_member");
  }
  for (const auto& [name, value] : object_.items()) {
    const auto same = [&name](const char* other) { return name == other; };
    if (std::ranges::none_of(known, same)) {
      return fail(ErrorCode::bad_request, fmt::format("{} is not known here", quote(name)), "unknown_member");
    }
  }
  return {};
}

Result<std::string> Members::text(const char* name, Range<std::size_t> bytes) const {
  if (!has(name)) return missing(name);
  const json& value = object_.at(name);
  if (!value.is_string()) return wrong_type(name, "a string", value);
  auto text = value.get<std::string>();
  if (text.size() < bytes.minimum || text.size() > bytes.maximum) {
    return fail(ErrorCode::invalid,
                fmt::format("{} has {} bytes, allowed are {} to {}", name, text.size(), bytes.minimum, bytes.maximum),
                "out_of_range");
  }
  return text;
}

Result<double> Members::number(const char* name) const {
  if (!has(name)) return missing(name);
  const json& value = object_.at(name);
  if (!value.is_number()) return wrong_type(name, "a number", value);
  return value.get<double>();
}

Result<float> Members::number_as_float(const char* name) const {
  const auto value = number(name);
  if (!value) return std::unexpected{value.error()};
  constexpr double kLargestFloat = std::numeric_limits<float>::max();
  if (std::abs(*value) > kLargestFloat) {
    return fail(ErrorCode::invalid, fmt::format("{} = {} is beyond ±{}", name, *value, kLargestFloat), "out_of_range");
  }
  return static_cast<float>(*value);
}

Result<std::int64_t> Members::integer(const char* name, Range<std::int64_t> allowed) const {
  if (!has(name)) return missing(name);
  const json& value = object_.at(name);
  if (!is_integer(value)) return wrong_type(name, "an integer", value);
  const std::optional<std::int64_t> integer = integer_of(value);
  if (!integer || *integer < allowed.minimum || *integer > allowed.maximum) {
    return fail(ErrorCode::invalid,
                fmt::format("{} = {} is outside {} to {}", name, quote(value), allowed.minimum, allowed.maximum),
                "out_of_range");
  }
  return *integer;
}

Result<void> Members::time(const char* name, std::optional<std::int64_t>& into) const {
  if (!has(name)) return {};
  const auto time_us = integer(name, {0, kMaxTimeUs});
  if (!time_us) return std::unexpected{time_us.error()};
  into = *time_us;
  return {};
}

Result<std::optional<double>> Members::optional_number(const char* name, Range<double> allowed) const {
  if (!has(name)) return std::nullopt;
  const auto value = number(name);
  if (!value) return std::unexpected{value.error()};
  if (*value >= allowed.minimum && *value <= allowed.maximum) return *value;
  return fail(ErrorCode::invalid,
              fmt::format("{} must be from {} to {}, is {}", name, allowed.minimum, allowed.maximum, *value),
              "out_of_range");
}

Result<bool> Members::flag(const char* name) const {
  if (!has(name)) return false;
  const json& value = object_.at(name);
  if (value.is_boolean()) return value.get<bool>();
  return fail(ErrorCode::bad_request, fmt::format("{} must be true or false", name), "wrong_type");
}

Result<std::uint64_t> Members::id(const char* name) const {
  if (!has(name)) return missing(name);
  const json& value = object_.at(name);
  const auto id = value.is_string() ? parse_id(value.get<std::string>()) : std::nullopt;
  if (!id) return wrong_type(name, "a string with a number from 1 to 18446744073709551615", value);
  return *id;
}

std::optional<std::uint64_t> parse_id(const std::string& text) {
  std::uint64_t id = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, id);
  if (error != std::errc{} || rest != end || id == 0) return std::nullopt;
  return id;
}

bool is_robot_id(const std::string& text) {
  const auto allowed = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-'; };
  return !text.empty() && text.size() <= 31 && std::ranges::all_of(text, allowed);
}

json to_json(const storage::Run& run) {
  json spans = json::array();
  for (const storage::RunSpan& span : run.spans) {
    json one;
    one["boot_id"] = std::to_string(span.boot_id);
    one["first_seq"] = span.first_seq;
    one["last_seq"] = span.last_seq ? json(*span.last_seq) : json(nullptr);
    spans.push_back(std::move(one));
  }
  const storage::RunConditions& conditions = run.conditions;
  json out;
  out["run_id"] = run.id;
  out["robot_id"] = run.robot_id;
  out["state"] = text(run.state);
  out["made_afterwards"] = run.made_afterwards;
  out["made_by"] = run.made_by;
  out["name"] = conditions.name;
  out["fluid"] = conditions.fluid;
  out["pump_profile"] = conditions.pump_profile;
  out["mean_flow_m_s"] = conditions.mean_flow_m_s ? json(*conditions.mean_flow_m_s) : json(nullptr);
  out["tube"] = conditions.tube;
  out["operator_name"] = conditions.operator_name;
  out["profile"] = conditions.profile;
  out["notes"] = conditions.notes;
  out["verdict"] = conditions.verdict;
  out["firmware_version"] = run.firmware_version;
  out["controller_id"] = run.controller_id;
  out["controller_checksum"] = run.controller_checksum;
  out["parameters_checksum"] = run.parameters_checksum;
  out["started_at_us"] = run.started_at_us;
  out["ended_at_us"] = run.ended_at_us ? json(*run.ended_at_us) : json(nullptr);
  out["spans"] = std::move(spans);
  out["samples_expected"] = run.samples_expected;
  out["samples_stored"] = run.samples_stored;
  out["samples_lost"] = run.samples_lost;
  out["missed_ticks"] = run.missed ? json(run.missed->count) : json(nullptr);
  out["longest_missed_ticks"] = run.missed ? json(run.missed->longest) : json(nullptr);
  out["experiment"] = nullptr;
  if (run.origin) {
    out["experiment"] = {{"experiment_id", run.origin->experiment},
                         {"number", run.origin->number},
                         {"profile_sha256", run.origin->profile_sha256}};
  }
  out["interrupted"] = json::array();
  for (const storage::InterruptedPart& part : run.interrupted) {
    out["interrupted"].push_back({{"span", part.span},
                                  {"from_robot_time_us", part.from_robot_us},
                                  {"to_robot_time_us", part.to_robot_us},
                                  {"reason", part.reason},
                                  {"detail", part.detail}});
  }
  return out;
}

}  // namespace server::api
