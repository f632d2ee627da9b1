// Each member is named once: a schema is what a message without values visits.
#include "server/live/foxglove/topics.hpp"

#include <cmath>
#include <concepts>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <type_traits>

#include "base/json_text.hpp"
#include "server/station/state/telemetry_message.hpp"

namespace server::live::foxglove {

using nlohmann::json;

namespace {

std::optional<std::int64_t> unless_negative(std::int64_t time_us) {
  return time_us < 0 ? std::nullopt : std::optional{time_us};
}

std::optional<std::int64_t> unless_zero(std::int64_t time_us) {
  return time_us == 0 ? std::nullopt : std::optional{time_us};
}

template <class Visit>
void visit_members(const station::RobotEvent& event, Visit visit) {
  visit("robot_id", event.robot_id);
  visit("boot_id", std::to_string(event.boot_id));
  visit("event_seq", event.event_seq);
  visit("robot_time_us", event.robot_time_us);
  visit("sample_seq", event.sample_seq);
  visit("kind", event.kind);
  visit("cause", event.cause);
  visit("mode", std::string{protocol::text(event.mode)});
  visit("sub_state", std::string{protocol::text(event.sub_state)});
  visit("position_m", event.position_m);
  visit("value", event.value);
  visit("emergency_id", std::to_string(event.emergency_id));
  visit("command_id", std::to_string(event.command_id));
  visit("received_at_us", event.received_at_us);
  const auto latch = event.emergency_cause.transform([](auto cause) { return std::string{protocol::text(cause)}; });
  visit("emergency_cause", latch);
  visit("detail", event.detail);
  visit("unknown_values", event.unknown_values);
}

template <class Visit>
void visit_members(const station::CommandRecord& command, Visit visit) {
  visit("command_id", std::to_string(command.id));
  visit("robot_id", command.robot_id);
  visit("boot_id", std::to_string(command.boot_id));
  visit("kind", command.kind);
  visit("arguments", command.arguments);
  visit("actor", command.actor);
  visit("state", std::string{text(command.state)});
  visit("reason", command.reason);
  visit("submitted_at_us", command.submitted_at_us);
  visit("sent_at_us", command.sent_at_us);
  visit("ended_at_us", command.ended_at_us);
  visit("effect_at_robot_us", command.effect_at_robot_us);
  visit("emergency_id", std::to_string(command.emergency_id));
  visit("sent_after_us", unless_negative(command.sent_after_us));
  visit("acknowledged_after_us", unless_negative(command.acknowledged_after_us));
  visit("verified_after_us", unless_negative(command.verified_after_us));
  visit("life_from", command.life_from);
  visit("further_renewals", command.further_renewals);
  visit("last_renewed_at_us", unless_zero(command.last_renewed_at_us));
}

const char* json_type_of(const std::string&) { return "string"; }
const char* json_type_of(float) { return "number"; }
const char* json_type_of(std::integral auto) { return "integer"; }
template <class Value>
const char* json_type_of(const std::optional<Value>&) {
  return json_type_of(Value{});
}

template <class Row>
std::string schema() {
  json properties = json::object();
  visit_members(Row{},
                [&](const char* name, const auto& value) { properties[name] = {{"type", json_type_of(value)}}; });
  return base::dump({{"type", "object"}, {"properties", properties}});
}

// A value that is none, or no finite number, is left out; a number is the shortest decimal of its binary32.
struct MessageWriter {
  void operator()(const char* name, float value) {
    if (std::isfinite(value)) message[name] = base::decimal(value);
  }
  template <class Value>
  void operator()(const char* name, const std::optional<Value>& value) {
    if (value) message[name] = *value;
  }
  template <class Value>
    requires(!std::floating_point<Value>)
  void operator()(const char* name, const Value& value) {
    message[name] = value;
  }
  json message = json::object();
};

template <class Row>
std::string message_of(const Row& row) {
  MessageWriter writer;
  visit_members(row, [&](const char* name, const auto& value) { writer(name, value); });
  return base::dump(writer.message);
}

}  // namespace

const char* name_of(Topic topic) {
  switch (topic) {
    case Topic::telemetry: return "/telemetry";
    case Topic::event: return "/event";
    default: return "/command";
  }
}

const char* schema_name_of(Topic topic) {
  switch (topic) {
    case Topic::telemetry: return station::kTelemetrySchemaName;
    case Topic::event: return "rheonaut.Event";
    default: return "rheonaut.Command";
  }
}

const std::string& schema_of(Topic topic) {
  static const std::array<std::string, kTopics.size()> schemas{station::telemetry_schema(station::ChosenFields{}.set()),
                                                               schema<station::RobotEvent>(),
                                                               schema<station::CommandRecord>()};
  return schemas[static_cast<std::size_t>(topic)];
}

std::string event_message(const station::RobotEvent& event) { return message_of(event); }

std::string command_message(const station::CommandRecord& command) { return message_of(command); }

}  // namespace server::live::foxglove
