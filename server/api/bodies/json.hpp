// JSON of the API: bodies of requests checked member by member, and recorded values as JSON.
//
// Errors: bad_request for what is not JSON or has a wrong form, invalid for a value out of range or an unknown kind;
// each sentence names the member and quotes the value.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "server/live/state_json.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/in_force.hpp"
#include "server/station/station.hpp"
#include "server/storage/query/history.hpp"

namespace server::api {

using live::to_json;  // beside those below

inline constexpr int kMaxJsonDepth = 16;  // of what is sent to the station; nothing that it knows needs more than 3

inline constexpr std::int64_t kMaxTimeUs = std::numeric_limits<std::int64_t>::max();

template <class Number>
struct Range {
  Number minimum, maximum;  // both allowed
};
inline nlohmann::json number_or_null(std::optional<double> value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

// The members of one JSON object, taken one by one.
class Members {
 public:
  // Errors when the text is not one JSON object, is nested too deep, or has a member that is not in `known`.
  static Result<Members> parse(const std::string& text, std::initializer_list<const char*> known);
  explicit Members(nlohmann::json object) : object_{std::move(object)} {}

  // Errors when there is another member, or one of the object is given twice (in any depth): the last of them counts.
  Result<void> only(std::initializer_list<const char*> known) const;
  bool has(const char* name) const { return object_.contains(name); }

  // Each errors when the member is missing or of another type or outside its range.
  Result<std::string> text(const char* name, Range<std::size_t> bytes) const;
  Result<double> number(const char* name) const;
  Result<float> number_as_float(const char* name) const;
  Result<std::int64_t> integer(const char* name, Range<std::int64_t> allowed) const;
  Result<std::uint64_t> id(const char* name) const;
  Result<void> time(const char* name, std::optional<std::int64_t>& into) const;  // left out: none

  // The value of a member that may be left out: none, or false, then.
  Result<std::optional<double>> optional_number(const char* name, Range<double> allowed) const;
  Result<bool> flag(const char* name) const;

  const nlohmann::json& object() const { return object_; }

 private:
  nlohmann::json object_;
  std::string repeated_;  // a member that is given twice in one object, quoted; empty: there is none
};

struct ParsedCommand {
  protocol::Command action;
  std::string arguments;  // as JSON, without what every command may have
  microseconds time_to_live{2'000'000};
  std::optional<std::int64_t> stamp_us;      // of /live: the station's steady time, as the page received it last
  std::optional<std::int64_t> issued_at_us;  // UTC
  bool is_confirmed = false;                 // its sender says that motion may be bounded otherwise
};

// The body of POST …/commands, e.g. {"kind":"set_setpoint","setpoint_m":0.1,"life_ms":2000}.
// `in_force`: the robot's controller, from which a new one has what its body leaves out; null: not known.
Result<ParsedCommand> parse_command(const std::string& body, const protocol::Controller* in_force = nullptr);

struct ParsedControl {
  station::ControlRequest request;       // robot and actor are left empty
  std::optional<std::int64_t> stamp_us;  // as above; of take and force alone
};

// The body of POST …/control, e.g. {"action":"take","lease_ms":3000}.
Result<ParsedControl> parse_control(const std::string& body);

struct RunRequest {
  station::RobotId robot_id;
  storage::RunConditions conditions;
  std::optional<storage::RecordedRange> range;  // of a run that is made afterwards
};
Result<RunRequest> parse_run(const std::string& body);
Result<std::string> parse_run_end(const std::string& body);  // the verdict; an empty body has none
Result<storage::RunAnnotation> parse_annotation(const std::string& body);
Result<std::string> parse_discard(const std::string& body);     // the reason
Result<std::uint64_t> parse_finalize(const std::string& body);  // how many samples are missing
struct MarkerBody {
  std::string text;
  std::optional<std::int64_t> at_us;
};
Result<MarkerBody> parse_marker(const std::string& body);

std::optional<std::uint64_t> parse_id(const std::string& text);  // decimal, not 0
bool is_robot_id(const std::string& text);

nlohmann::json to_json(const storage::Run& run);

// {"<name>": [ … ]}
template <class Items>
nlohmann::json list_json(const char* name, const Items& items) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& item : items) list.push_back(to_json(item));
  return {{name, std::move(list)}};
}

// A page of a list that was read with one more item than `limit`, which shows whether there are others:
// {"<name>": [ … ], "next": the cursor of its last item, or null}
template <class Items, class JsonOf, class CursorOf>
nlohmann::json page_json(const char* name, const Items& items, std::size_t limit, JsonOf json_of, CursorOf cursor_of) {
  nlohmann::json list = nlohmann::json::array(), next;
  for (const auto& item : items) {
    if (list.size() == limit) return {{name, std::move(list)}, {"next", std::move(next)}};
    list.push_back(json_of(item));
    next = cursor_of(item);
  }
  return {{name, std::move(list)}, {"next", nullptr}};
}

}  // namespace server::api
