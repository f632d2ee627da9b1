// Reads the bodies of commands: a function for each kind, and what every command may carry.
#include <fmt/format.h>

#include <algorithm>

#include "server/api/bodies/controller_body.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/limits.hpp"
#include "server/storage/samples/in_force_json.hpp"

namespace server::api {
namespace {

using nlohmann::json;

Result<void> read_set_mode(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"mode", "setpoint_m"}); !known) return known;
  const auto mode = body.text("mode", {0, kMaxLongWordBytes});
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

Result<void> read_only_float(const Members& body, const char* name, float& into) {
  if (auto known = body.only({name}); !known) return known;
  const auto value = body.number_as_float(name);
  if (!value) return std::unexpected{value.error()};
  into = *value;
  return {};
}

Result<void> read_set_setpoint(const Members& body, protocol::Command& action) {
  action.which_action = rheonaut_Command_set_setpoint_tag;
  return read_only_float(body, "setpoint_m", action.action.set_setpoint.setpoint_m);
}

Result<void> read_inject_disturbance(const Members& body, protocol::Command& action) {
  action.which_action = rheonaut_Command_inject_disturbance_tag;
  return read_only_float(body, "disturbance_m", action.action.inject_disturbance.disturbance_m);
}

Result<void> read_lease(const Members& body, Range<std::int64_t> allowed, std::uint32_t& lease_ms) {
  if (!body.has("lease_ms")) return {};
  const auto value = body.integer("lease_ms", allowed);
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
  return read_lease(body, integers("SetDutyBody.lease_ms"), action.action.set_duty.lease_ms);
}

Result<void> read_renew_lease(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"lease_ms"}); !known) return known;
  action.which_action = rheonaut_Command_renew_lease_tag;
  return read_lease(body, integers("RenewLeaseBody.lease_ms"), action.action.renew_lease.lease_ms);
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
  const auto name = body.text("name", text_bytes("SetParameterBody.name"));
  if (!name) return std::unexpected{name.error()};
  const auto value = body.number_as_float("value");
  if (!value) return std::unexpected{value.error()};
  name->copy(set_parameter.name, sizeof set_parameter.name - 1);
  set_parameter.value = *value;
  if (!station::bounds_motion(*name)) {
    if (!body.has("confirm")) return {};
    return fail(ErrorCode::bad_request, "confirm goes only with parameters that bound motion", "unknown_member");
  }
  if (body.has("confirm") && body.object().at("confirm") == json(true)) return {};
  return fail(ErrorCode::invalid,
              fmt::format("the parameter {} bounds motion; to change it, add \"confirm\": true (--confirm)", *name),
              "confirm_required");
}

Result<void> read_get_parameters(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"first_index"}); !known) return known;
  action.which_action = rheonaut_Command_get_parameters_tag;
  if (!body.has("first_index")) return {};
  const auto first_index = body.integer("first_index", integers("GetParametersBody.first_index"));
  if (!first_index) return std::unexpected{first_index.error()};
  action.action.get_parameters.first_index = static_cast<std::uint32_t>(*first_index);
  return {};
}

Result<void> read_restore_controller(const Members& body, protocol::Command& action) {
  action.which_action = rheonaut_Command_restore_controller_tag;
  return body.only({"confirm"});
}

Result<void> read_set_controller(const Members& body, const protocol::Controller* in_force, protocol::Command& action) {
  auto known = body.only({"controller", "controller_id", "duty_min", "duty_max", "derivative_on", "confirm"});
  if (!known) return known;
  action.which_action = rheonaut_Command_set_controller_tag;
  const auto controller = controller_from(body, in_force);
  if (!controller) return std::unexpected{controller.error()};
  action.action.set_controller = *controller;
  return {};
}

// What a robot would call malformed, said so that somebody can mend it.
Result<void> read_set_duty_schedule(const Members& body, protocol::Command& action) {
  if (auto known = body.only({"schedule"}); !known) return known;
  action.which_action = rheonaut_Command_set_duty_schedule_tag;
  auto& schedule = action.action.set_duty_schedule;
  constexpr Range<std::size_t> kEntries = list_size("SetDutyScheduleBody.schedule");
  static_assert(kEntries.maximum == std::size(rheonaut_SetDutySchedule{}.duty));
  if (!body.has("schedule")) return fail(ErrorCode::bad_request, "schedule is missing", "missing_member");
  const json& entries = body.object().at("schedule");
  if (!entries.is_array()) return fail(ErrorCode::bad_request, "schedule is not a list", "wrong_type");
  if (entries.size() < kEntries.minimum || entries.size() > kEntries.maximum) {
    return fail(ErrorCode::invalid,
                fmt::format("schedule has {} entries, allowed are {} to {}", entries.size(), kEntries.minimum,
                            kEntries.maximum),
                "out_of_range");
  }
  Range<std::int64_t> ticks = integers("SetDutyScheduleBody.schedule[].tick");
  for (const json& entry : entries) {
    if (!entry.is_object()) return fail(ErrorCode::bad_request, "an entry of schedule is not an object", "wrong_type");
    const Members members{entry};
    if (auto known = members.only({"tick", "duty"}); !known) return known;
    const auto tick = members.integer("tick", ticks);
    if (!tick) return std::unexpected{tick.error()};
    const auto duty = members.number_as_float("duty");
    if (!duty) return std::unexpected{duty.error()};
    schedule.tick[schedule.tick_count++] = static_cast<std::uint32_t>(*tick);
    schedule.duty[schedule.duty_count++] = *duty;
    ticks.minimum = *tick + 1;
  }
  if (schedule.duty[schedule.duty_count - 1] == 0.0F) return {};
  return fail(ErrorCode::invalid, "the last duty of a schedule is 0", "out_of_range");
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
  Result<void> (*read)(const Members& body, protocol::Command& action);  // null: needs the controller in force
  bool may_wait = false;                                                 // on the robot, for its time
};
constexpr Kind kKinds[] = {
    {"set_mode", read_set_mode, true},
    {"set_setpoint", read_set_setpoint, true},
    {"set_duty", read_set_duty, true},
    {"set_duty_schedule", read_set_duty_schedule, true},
    {"renew_lease", read_renew_lease},
    {"clear_emergency", read_clear_emergency},
    {"inject_disturbance", read_inject_disturbance, true},
    {"set_parameter", read_set_parameter},
    {"get_parameters", read_get_parameters},
    {"set_controller", nullptr},
    {"restore_controller", read_restore_controller},
    {"zero_position", read_zero_position},
    {"ping", read_ping},
};

// The time at which a command is to act, in the robot's clock; taken out of the members of its kind.
Result<void> read_execute_at(const Kind& kind, json& arguments, protocol::Command& action) {
  constexpr const char* kName = "execute_at_robot_us";
  if (!arguments.contains(kName)) return {};
  if (!kind.may_wait) {
    return fail(ErrorCode::bad_request, fmt::format("{} takes no {}: it acts at once", kind.name, kName),
                "unknown_member");
  }
  const auto at_us = Members{arguments}.integer(kName, integers("ExecuteAtRobotUs"));
  if (!at_us) return std::unexpected{at_us.error()};
  action.has_execute_at_robot_us = true;
  action.execute_at_robot_us = static_cast<std::uint64_t>(*at_us);
  arguments.erase(kName);
  return {};
}

// What says that motion may be bounded otherwise.
Result<void> read_confirm(const json& arguments, bool& is_confirmed) {
  if (!arguments.contains("confirm")) return {};
  is_confirmed = arguments.at("confirm") == json(true);
  if (is_confirmed) return {};
  return fail(ErrorCode::invalid, "confirm is true or left out", "confirm_required");
}

// A controller is recorded as it was sent to the robot.
std::string controller_arguments(const protocol::Controller& controller, bool is_confirmed) {
  json arguments{{"controller", storage::controller_json(controller)}};
  if (is_confirmed) arguments["confirm"] = true;
  return base::dump(arguments);
}

}  // namespace

Result<ParsedCommand> parse_command(const std::string& text, const protocol::Controller* in_force) {
  const auto body = Members::parse(text, {});
  if (!body) return std::unexpected{body.error()};
  const auto kind = body->text("kind", {0, kMaxLongWordBytes});
  if (!kind) return std::unexpected{kind.error()};
  const auto* known = std::ranges::find_if(kKinds, [&kind](const Kind& one) { return *kind == one.name; });
  if (known == std::end(kKinds)) {
    return fail(ErrorCode::invalid, fmt::format("unknown command kind '{}'", kind->substr(0, 40)), "unknown_kind");
  }
  ParsedCommand command;
  if (body->has("life_ms")) {
    const auto life_ms = body->integer("life_ms", integers("LifeMs"));
    if (!life_ms) return std::unexpected{life_ms.error()};
    command.time_to_live = std::chrono::milliseconds{*life_ms};
  }
  if (auto read = body->time("stamp_us", command.stamp_us); !read) return std::unexpected{read.error()};
  if (auto read = body->time("issued_at_us", command.issued_at_us); !read) return std::unexpected{read.error()};
  if (command.stamp_us && command.issued_at_us) {
    return fail(ErrorCode::bad_request, "stamp_us and issued_at_us say the same in two ways; send one of them",
                "malformed");
  }
  json arguments = body->object();
  for (const char* of_all : {"kind", "life_ms", "stamp_us", "issued_at_us"}) arguments.erase(of_all);
  command.arguments = base::dump(arguments);
  command.action = rheonaut_Command_init_zero;
  if (auto read = read_execute_at(*known, arguments, command.action); !read) return std::unexpected{read.error()};
  const Members action{std::move(arguments)};
  const auto read = known->read != nullptr ? known->read(action, command.action)
                                           : read_set_controller(action, in_force, command.action);
  if (!read) return std::unexpected{read.error()};
  if (auto confirm = read_confirm(action.object(), command.is_confirmed); !confirm) {
    return std::unexpected{confirm.error()};
  }
  if (command.action.which_action == rheonaut_Command_set_controller_tag) {
    command.arguments = controller_arguments(command.action.action.set_controller, command.is_confirmed);
  }
  return command;
}

}  // namespace server::api
