// Reads the bodies of requests: commands, runs, markers.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "server/api/json.hpp"

namespace server {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxNameBytes = 200;
constexpr std::size_t kMaxTextBytes = 4000;
constexpr std::int64_t kMaxLifeMs = protocol::kMaxCommandLifeUs / 1000;

Result<void> read_set_mode(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"mode", "setpoint_m"}); !known) return known;
  const auto mode = body.text("mode", 0, kMaxTextBytes);
  if (!mode) return std::unexpected{mode.error()};
  action.which_action = rheonaut_Command_set_mode_tag;
  auto& set_mode = action.action.set_mode;
  if (*mode == "manual") {
    set_mode.mode = rheonaut_MODE_MANUAL;
    if (!body.has("setpoint_m")) return {};
    return fail(ErrorCode::bad_request, "setpoint_m is not known here: mode manual takes none", "unknown_member");
  }
  if (*mode != "auto") {
    return fail(ErrorCode::invalid, fmt::format("mode = '{}' is neither manual nor auto", mode->substr(0, 40)),
                "out_of_range");
  }
  const auto setpoint_m = body.number_as_float("setpoint_m");
  if (!setpoint_m) return std::unexpected{setpoint_m.error()};
  set_mode.mode = rheonaut_MODE_AUTO;
  set_mode.has_setpoint_m = true;
  set_mode.setpoint_m = *setpoint_m;
  return {};
}

Result<void> read_float(const Members& body, const char* name, float& into) {
  if (auto known = body.only({name}); !known) return known;
  const auto value = body.number_as_float(name);
  if (!value) return std::unexpected{value.error()};
  into = *value;
  return {};
}

Result<void> read_set_setpoint(const Members& body, protocol::Command& action) {
  action.which_action = rheonaut_Command_set_setpoint_tag;
  return read_float(body, "setpoint_m", action.action.set_setpoint.setpoint_m);
}

Result<void> read_inject_disturbance(const Members& body, protocol::Command& action) {
  action.which_action = rheonaut_Command_inject_disturbance_tag;
  return read_float(body, "disturbance_m", action.action.inject_disturbance.disturbance_m);
}

Result<void> read_lease(const Members& body, std::uint32_t& lease_ms) {
  if (!body.has("lease_ms")) return {};
  const auto value = body.integer("lease_ms", 1, protocol::kLeaseMs);
  if (!value) return std::unexpected{value.error()};
  lease_ms = static_cast<std::uint32_t>(*value);
  return {};
}

Result<void> read_set_duty(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"duty", "lease_ms"}); !known) return known;
  const auto duty = body.number_as_float("duty");
  if (!duty) return std::unexpected{duty.error()};
  action.which_action = rheonaut_Command_set_duty_tag;
  action.action.set_duty.duty = *duty;
  return read_lease(body, action.action.set_duty.lease_ms);
}

Result<void> read_renew_lease(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"lease_ms"}); !known) return known;
  action.which_action = rheonaut_Command_renew_lease_tag;
  return read_lease(body, action.action.renew_lease.lease_ms);
}

Result<void> read_clear_emergency(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"emergency_id"}); !known) return known;
  const auto id = body.id("emergency_id");
  if (!id) return std::unexpected{id.error()};
  action.which_action = rheonaut_Command_clear_emergency_tag;
  action.action.clear_emergency.emergency_id = *id;
  return {};
}

// SAFETY: what bounds motion is not changed by the way: see bounds_motion.
Result<void> read_set_parameter(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"name", "value", "confirm"}); !known) return known;
  action.which_action = rheonaut_Command_set_parameter_tag;
  auto& set_parameter = action.action.set_parameter;
  const auto name = body.text("name", 1, sizeof set_parameter.name - 1);
  if (!name) return std::unexpected{name.error()};
  const auto value = body.number_as_float("value");
  if (!value) return std::unexpected{value.error()};
  name->copy(set_parameter.name, sizeof set_parameter.name - 1);
  set_parameter.value = *value;
  if (!bounds_motion(*name)) {
    if (!body.has("confirm")) return {};
    return fail(ErrorCode::bad_request, "confirm goes only with parameters that bound motion", "unknown_member");
  }
  if (body.has("confirm") && body.object().at("confirm") == json(true)) return {};
  return fail(ErrorCode::invalid,
              fmt::format("the parameter {} bounds motion; send \"confirm\": true to change it all the same", *name),
              "confirm_required");
}

Result<void> read_zero_position(const Members& body, protocol::Command& action) {
  action.which_action = rheonaut_Command_zero_position_tag;
  return body.only({});
}

Result<void> read_ping(const Members& body, protocol::Command& action) {
  action.which_action = rheonaut_Command_ping_tag;
  return body.only({});
}

struct Kind {
  const char* name;
  Result<void> (*read)(const Members& body, protocol::Command& action);
};
constexpr Kind kKinds[] = {
    {"set_mode", read_set_mode},
    {"set_setpoint", read_set_setpoint},
    {"set_duty", read_set_duty},
    {"renew_lease", read_renew_lease},
    {"clear_emergency", read_clear_emergency},
    {"inject_disturbance", read_inject_disturbance},
    {"set_parameter", read_set_parameter},
    {"zero_position", read_zero_position},
    {"ping", read_ping},
};

Result<void> read_text(const Members& body, const char* name, std::string& into) {
  if (!body.has(name)) return {};
  auto value = body.text(name, 0, kMaxTextBytes);
  if (!value) return std::unexpected{value.error()};
  into = std::move(*value);
  return {};
}

constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();

Result<RecordedRange> read_range(const json& value) {
  if (!value.is_object()) return fail(ErrorCode::bad_request, "span is not an object", "wrong_type");
  const Members span{value};
  if (span.has("boot_id")) {
    if (auto known = span.only({"boot_id", "first_seq", "last_seq"}); !known) return std::unexpected{known.error()};
    const auto boot_id = span.id("boot_id");
    if (!boot_id) return std::unexpected{boot_id.error()};
    const auto first = span.integer("first_seq", 0, kLargest - 1);
    if (!first) return std::unexpected{first.error()};
    const auto last = span.integer("last_seq", *first, kLargest - 1);
    if (!last) return std::unexpected{last.error()};
    return SeqSpan{*boot_id, static_cast<std::uint64_t>(*first), static_cast<std::uint64_t>(*last)};
  }
  if (auto known = span.only({"from_us", "to_us"}); !known) return std::unexpected{known.error()};
  const auto from_us = span.integer("from_us", 0, kLargest - 1);
  if (!from_us) return std::unexpected{from_us.error()};
  const auto to_us = span.integer("to_us", *from_us, kLargest - 1);
  if (!to_us) return std::unexpected{to_us.error()};
  return TimeSpan{*from_us, *to_us};
}

Result<void> read_time(const Members& body, const char* name, std::optional<std::int64_t>& into) {
  if (!body.has(name)) return {};
  const auto time_us = body.integer(name, 0, std::numeric_limits<std::int64_t>::max());
  if (!time_us) return std::unexpected{time_us.error()};
  into = *time_us;
  return {};
}

}  // namespace

bool bounds_motion(const std::string& parameter) {
  constexpr const char* kBounds[] = {"auto_limit_s",         "setpoint_limit_m",     "link_timeout_ms",
                                     "position_limit_min_m", "position_limit_max_m", "power_limit_duty",
                                     "power_limit_s",        "link_loss_action",     "link_loss_limit_s"};
  return std::ranges::find(kBounds, parameter) != std::end(kBounds);
}

Result<ParsedCommand> parse_command(const std::string& text) {
  const auto body = Members::parse(text, {});
  if (!body) return std::unexpected{body.error()};
  const auto kind = body->text("kind", 0, kMaxTextBytes);
  if (!kind) return std::unexpected{kind.error()};
  const auto* known = std::ranges::find_if(kKinds, [&kind](const Kind& one) { return *kind == one.name; });
  if (known == std::end(kKinds)) {
    return fail(ErrorCode::invalid, fmt::format("unknown command kind '{}'", kind->substr(0, 40)), "unknown_kind");
  }
  ParsedCommand command;
  if (body->has("life_ms")) {
    const auto life_ms = body->integer("life_ms", 1, kMaxLifeMs);
    if (!life_ms) return std::unexpected{life_ms.error()};
    command.life = std::chrono::milliseconds{*life_ms};
  }
  if (auto read = read_time(*body, "stamp_us", command.stamp_us); !read) return std::unexpected{read.error()};
  if (auto read = read_time(*body, "issued_at_us", command.issued_at_us); !read) return std::unexpected{read.error()};
  if (command.stamp_us && command.issued_at_us) {
    return fail(ErrorCode::bad_request, "stamp_us and issued_at_us say the same in two ways; send one of them",
                "malformed");
  }
  json arguments = body->object();
  for (const char* of_all : {"kind", "life_ms", "stamp_us", "issued_at_us"}) arguments.erase(of_all);
  command.arguments = dump(arguments);
  command.action = rheonaut_Command_init_zero;
  const Members action{std::move(arguments)};
  if (auto read = known->read(action, command.action); !read) return std::unexpected{read.error()};
  return command;
}

Result<ParsedControl> parse_control(const std::string& text) {
  const auto body = Members::parse(text, {"action", "lease_ms", "reason", "stamp_us"});
  if (!body) return std::unexpected{body.error()};
  const auto action = body->text("action", 1, kMaxNameBytes);
  if (!action) return std::unexpected{action.error()};
  constexpr std::pair<const char*, ControlAction> kActions[] = {{"take", ControlAction::take},
                                                                {"force", ControlAction::force},
                                                                {"release", ControlAction::release},
                                                                {"request", ControlAction::request},
                                                                {"hand_over", ControlAction::hand_over}};
  const auto* known = std::ranges::find(kActions, *action, [](const auto& one) { return std::string{one.first}; });
  if (known == std::end(kActions)) {
    return fail(ErrorCode::invalid,
                fmt::format("action = '{}' is none of take, force, release, request, hand_over", action->substr(0, 40)),
                "out_of_range");
  }
  ParsedControl control;
  ControlRequest& request = control.request;
  request.action = known->second;
  const bool is_forced = request.action == ControlAction::force;
  if (body->has("stamp_us") && request.action != ControlAction::take && !is_forced) {
    return fail(ErrorCode::bad_request, "stamp_us goes with take and force only", "unknown_member");
  }
  if (auto read = read_time(*body, "stamp_us", control.stamp_us); !read) return std::unexpected{read.error()};
  if (body->has("lease_ms")) {
    if (request.action != ControlAction::take) {
      return fail(ErrorCode::bad_request, "lease_ms goes with take only", "unknown_member");
    }
    const auto lease_ms = body->integer("lease_ms", 1, kLongestControl.count() / 1000);
    if (!lease_ms) return std::unexpected{lease_ms.error()};
    request.life = std::chrono::milliseconds{*lease_ms};
  }
  if (!is_forced && body->has("reason")) {
    return fail(ErrorCode::bad_request, "reason goes with force only", "unknown_member");
  }
  if (is_forced) {
    auto reason = body->text("reason", 1, kMaxNameBytes);
    if (!reason) return std::unexpected{reason.error()};
    request.reason = std::move(*reason);
  }
  return control;
}

Result<RunWish> parse_run(const std::string& text) {
  const auto body = Members::parse(text, {"robot_id", "name", "fluid", "pump_profile", "mean_flow_m_s", "tube",
                                          "operator_name", "profile", "notes", "span"});
  if (!body) return std::unexpected{body.error()};
  RunWish wish;
  const auto robot_id = body->text("robot_id", 0, kMaxTextBytes);
  if (!robot_id) return std::unexpected{robot_id.error()};
  if (!is_robot_id(*robot_id)) {
    return fail(ErrorCode::invalid, "robot_id is not 1 to 31 characters of [a-z0-9_-]", "out_of_range");
  }
  wish.robot_id = *robot_id;
  const auto name = body->text("name", 1, kMaxNameBytes);
  if (!name) return std::unexpected{name.error()};
  RunConditions& conditions = wish.conditions;
  conditions.name = *name;
  if (body->has("mean_flow_m_s")) {
    const auto flow = body->number("mean_flow_m_s");
    if (!flow) return std::unexpected{flow.error()};
    conditions.mean_flow_m_s = *flow;
  }
  const std::pair<const char*, std::string*> texts[] = {
      {"fluid", &conditions.fluid},     {"pump_profile", &conditions.pump_profile},
      {"tube", &conditions.tube},       {"operator_name", &conditions.operator_name},
      {"profile", &conditions.profile}, {"notes", &conditions.notes}};
  for (const auto& [member, into] : texts) {
    if (auto read = read_text(*body, member, *into); !read) return std::unexpected{read.error()};
  }
  if (!body->has("span")) return wish;
  auto range = read_range(body->object().at("span"));
  if (!range) return std::unexpected{range.error()};
  wish.range = *range;
  return wish;
}

Result<std::string> parse_run_end(const std::string& text) {
  std::string verdict;
  if (text.empty()) return verdict;
  const auto body = Members::parse(text, {"verdict"});
  if (!body) return std::unexpected{body.error()};
  if (auto read = read_text(*body, "verdict", verdict); !read) return std::unexpected{read.error()};
  return verdict;
}

Result<RunAnnotation> parse_annotation(const std::string& text) {
  const auto body = Members::parse(
      text, {"name", "fluid", "pump_profile", "mean_flow_m_s", "tube", "operator_name", "profile", "notes", "verdict"});
  if (!body) return std::unexpected{body.error()};
  RunAnnotation annotation;
  for (const auto& [member, value] : body->object().items()) {
    if (member == "mean_flow_m_s") continue;
    const bool is_name = member == "name";
    const auto given = body->text(member.c_str(), is_name ? 1 : 0, is_name ? kMaxNameBytes : kMaxTextBytes);
    if (!given) return std::unexpected{given.error()};
    annotation.texts[member] = *given;
  }
  annotation.has_mean_flow = body->has("mean_flow_m_s");
  if (!annotation.has_mean_flow || body->object().at("mean_flow_m_s").is_null()) return annotation;
  const auto flow = body->number("mean_flow_m_s");
  if (!flow) return std::unexpected{flow.error()};
  annotation.mean_flow_m_s = *flow;
  return annotation;
}

Result<std::string> parse_discard(const std::string& text) {
  const auto body = Members::parse(text, {"reason"});
  if (!body) return std::unexpected{body.error()};
  return body->text("reason", 1, kMaxTextBytes);
}

Result<MarkerBody> parse_marker(const std::string& text) {
  const auto body = Members::parse(text, {"text", "at_us"});
  if (!body) return std::unexpected{body.error()};
  const auto said = body->text("text", 1, kMaxTextBytes);
  if (!said) return std::unexpected{said.error()};
  MarkerBody marker{*said, {}};
  if (!body->has("at_us")) return marker;
  const auto at_us = body->integer("at_us", 0, kLargest - 1);
  if (!at_us) return std::unexpected{at_us.error()};
  marker.at_us = *at_us;
  return marker;
}

}  // namespace server
