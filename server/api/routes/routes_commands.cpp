// What is sent to robots: commands, control and emergency stops.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <ranges>

#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/emergency.hpp"
#include "server/api/routes/routes.hpp"
#include "server/identity/auth.hpp"
#include "server/station/commands/recent_commands.hpp"
#include "server/station/station.hpp"
#include "server/storage/query/history.hpp"

namespace server::api {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

// What became of a command that was sent.
http::Response command_response(const station::CommandRecord& record) {
  const json with_command{{"command", to_json(record)}};
  switch (record.state) {
    case station::CommandState::acknowledged:
    case station::CommandState::verified: return http::json_response(200, to_json(record));
    case station::CommandState::superseded:
      return http::problem(
          {ErrorCode::conflict, fmt::format("{} was superseded: {}", record.kind, record.reason), "superseded"},
          with_command);
    case station::CommandState::rejected:
      return http::problem(
          {ErrorCode::rejected, fmt::format("the robot refused {}: {}", record.kind, record.reason), record.reason},
          with_command);
    case station::CommandState::failed:
      return http::problem(
          {ErrorCode::conflict, fmt::format("{} failed: {}", record.kind, record.reason), record.reason}, with_command);
    case station::CommandState::expired:
      return http::problem({ErrorCode::timed_out, fmt::format("{} expired before it took effect", record.kind),
                            record.reason.empty() ? "expired" : record.reason},
                           with_command);
    case station::CommandState::unknown: {
      const char* what = record.reason == "duplicate" ? "the robot has had this {} before, and says no more of it"
                                                      : "the robot did not answer {}";
      return http::problem(
          {ErrorCode::timed_out, fmt::format(fmt::runtime(what), record.kind) + "; whether it has run is not known yet",
           record.reason},
          with_command);
    }
    case station::CommandState::queued:
    case station::CommandState::sent: break;
  }
  return http::problem(
      {ErrorCode::timed_out, fmt::format("the robot did not answer {} in time", record.kind), "timed_out"},
      with_command);
}

// The client's own name of a request, in the header Idempotency-Key.
Result<std::string> key_of(const http::Request& request) {
  std::string key = request.header("idempotency-key");
  if (key.empty() || station::is_command_key(key)) return key;
  return fail(ErrorCode::bad_request, "Idempotency-Key must be 1 to 64 characters of A-Z a-z 0-9 . _ : -",
              "malformed_key");
}

constexpr std::int64_t kClockToleranceUs = 1'000'000;  // of a script's clock ahead of ours

// SAFETY: what a page asks for is worth as little as what its operator saw was old, so a page says what that was. (Only
// a script is near enough to the station for a time to live that counts from the arrival.)
Result<void> check_stamp(const identity::Caller& caller, const std::optional<std::int64_t>& stamp_us) {
  if (caller.session == 0 || stamp_us) return {};
  return fail(ErrorCode::invalid, "a page must send stamp_us, the latest stamp that it received on /live",
              "stamp_required");
}

Result<microseconds> age_of_stamp(std::int64_t stamp_us, runtime::Clock& clock) {
  const std::int64_t age_us = clock.steady_us() - stamp_us;
  if (age_us < 0) return fail(ErrorCode::invalid, "stamp_us is none that /live has said", "out_of_range");
  return microseconds{age_us};
}

// How long ago the command was issued, by what its sender says of that, or else since it arrived.
Result<void> set_age(station::CommandRequest& command, const ParsedCommand& parsed, runtime::Clock& clock) {
  std::int64_t age_us = command.received_us == 0 ? 0 : clock.steady_us() - command.received_us;
  if (parsed.stamp_us) {
    command.life_from = "stamp";
    const auto age = age_of_stamp(*parsed.stamp_us, clock);
    if (!age) return std::unexpected{age.error()};
    age_us = age->count();
  } else if (parsed.issued_at_us) {
    command.life_from = "issued_at";
    age_us = clock.utc_us() - *parsed.issued_at_us;
    if (age_us < -kClockToleranceUs) {
      return fail(ErrorCode::invalid,
                  fmt::format("issued_at_us lies {} ms ahead of the station's clock; set one of the clocks right",
                              -age_us / 1000),
                  "out_of_range");
    }
  }
  command.age = microseconds{std::max<std::int64_t>(age_us, 0)};
  return {};
}

// A request that is refused before it reaches the station: it is no command or action that the station knows, or one
// that only an admin may send.
http::Response refused(CommandRoutes parts, const http::Request& request, const char* what, const Error& error) {
  parts.station.note_refusal(author_of(request, parts.clock), request.param.at("robot_id"), what, "{}", error);
  return http::problem(error, identity::Role::admin);
}

// Whether the controller that comes into force has more of the motor than the one in force; also when that is not
// known.
bool widens_duty(const protocol::Controller* next, const protocol::Controller* in_force) {
  if (next == nullptr || in_force == nullptr) return true;
  return next->duty_min < in_force->duty_min || next->duty_max > in_force->duty_max;
}

// What of a robot's motion the command bounds otherwise, in words; empty: nothing.
std::string bounded_by(const ParsedCommand& command, const station::RobotSettings* known) {
  const protocol::Command& action = command.action;
  const bool is_current = known != nullptr && known->is_controller_current;
  const protocol::Controller* in_force = is_current ? &*known->controller : nullptr;
  switch (action.which_action) {
    case rheonaut_Command_set_parameter_tag: {
      const std::string name = action.action.set_parameter.name;
      return station::bounds_motion(name) ? fmt::format("the parameter {} bounds motion", name) : "";
    }
    case rheonaut_Command_set_controller_tag:
      if (!widens_duty(&action.action.set_controller, in_force)) return "";
      return in_force == nullptr ? "the duty range of the controller in force is not known"
                                 : fmt::format("its duty range is wider than {} to {}, that of the controller in force",
                                               in_force->duty_min, in_force->duty_max);
    case rheonaut_Command_restore_controller_tag: {
      const bool knows_former = is_current && known->controller_before.has_value();
      if (!widens_duty(knows_former ? &*known->controller_before : nullptr, in_force)) return "";
      return "the controller that comes back may have a wider duty range than the one in force";
    }
    default: return "";
  }
}

// SAFETY: the limits of a robot's motion are changed by admins alone, and never by the way.
Result<void> may_bound_motion(const identity::Caller& caller, const ParsedCommand& command,
                              const station::RobotSettings* known) {
  const std::string what = bounded_by(command, known);
  if (what.empty()) return {};
  if (!caller.scopes.allow(identity::Scope::admin)) {
    return fail(ErrorCode::forbidden, what + "; to change it needs the role admin", "not_permitted");
  }
  if (command.is_confirmed) return {};
  return fail(ErrorCode::invalid, what + "; to change it, add \"confirm\": true (--confirm)", "confirm_required");
}

// What the caller may not send now. It is judged when nothing is waited for any more.
Result<void> may_send_now(const http::Request& request, const ParsedCommand& parsed,
                          const station::RobotSettings* settings) {
  if (auto fresh = check_stamp(request.caller, parsed.stamp_us); !fresh) return fresh;
  return may_bound_motion(request.caller, parsed, settings);
}

// The station then knows a command of this id that ended before a restart, or long ago. What is not on the disk yet it
// knows by itself.
// SAFETY: a disk that fails keeps no command waiting until it is too old to be sent, such as a duty of 0.
asio::awaitable<void> recall(CommandRoutes parts, station::RobotId robot_id, station::CommandId id) {
  if (parts.station.known_command(robot_id, id) != nullptr) co_return;
  const auto stored = co_await parts.history.stored_command(id);
  if (stored && stored->ended_at_us != 0) parts.station.remember(*stored);
}

// A set_controller has from it what its body leaves out. The first of a key has it from the controller in force; the
// repeat from the controller that was sent then, so that it is the same command whatever is in force by now.
std::optional<protocol::Controller> controller_to_complete_from(const station::CommandRecord* first,
                                                                const station::RobotSettings* settings) {
  if (first != nullptr && first->kind == "set_controller") {
    json sent = json::parse(first->arguments);
    sent["kind"] = first->kind;
    const auto parsed = parse_command(base::dump(sent));
    return parsed ? std::optional{parsed->action.action.set_controller} : std::nullopt;
  }
  const bool is_known = settings != nullptr && settings->is_controller_current;
  return is_known ? settings->controller : std::nullopt;
}

station::CommandRequest request_of(const http::Request& request, ParsedCommand& parsed, std::string key) {
  station::CommandRequest command;
  command.robot_id = request.param.at("robot_id");
  command.action = parsed.action;
  command.arguments = std::move(parsed.arguments);
  command.actor = request.actor;
  command.client = request.caller.client;
  command.peer = request.peer;
  command.time_to_live = parsed.time_to_live;
  command.key = std::move(key);
  command.received_us = request.received_us;
  command.unread = request.unread;
  return command;
}

}  // namespace

http::Answer submit_command(CommandRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  if (parts.station.find(id) == nullptr) co_return unknown_robot(id);
  auto key = key_of(request);
  if (!key) co_return refused(parts, request, "command", key.error());
  const auto wait = request.query.find("wait");
  if (wait != request.query.end() && wait->second != "acknowledged" && wait->second != "verified") {
    co_return http::problem(400, "wait must be acknowledged or verified", "out_of_range");
  }
  const station::CommandId key_id = station::command_id_of(id, request.actor, *key);
  if (!key->empty()) co_await recall(parts, id, key_id);

  if (auto stands = still_stands(request.caller); !stands) {
    const Error& error = stands.error();
    parts.station.note_refusal(author_of(request, parts.clock), id, "command", "{}", error);
    co_return http::problem(error);
  }
  const station::RobotSettings* settings = parts.station.settings(id);
  const station::CommandRecord* first = key->empty() ? nullptr : parts.station.known_command(id, key_id);
  const auto complete_from = controller_to_complete_from(first, settings);
  auto parsed = parse_command(request.body, complete_from ? &*complete_from : nullptr);
  if (!parsed) co_return refused(parts, request, "command", parsed.error());
  station::CommandRequest command = request_of(request, *parsed, std::move(*key));
  command.until_verified = wait != request.query.end() && wait->second == "verified";
  if (first == nullptr) {  // a repeat is answered as the first was, and sends nothing
    if (auto may = may_send_now(request, *parsed, settings); !may) {
      co_return refused(parts, request, "command", may.error());
    }
    if (auto aged = set_age(command, *parsed, parts.clock); !aged) {
      co_return refused(parts, request, "command", aged.error());
    }
  }
  const auto record = co_await parts.station.submit(std::move(command));
  if (!record) co_return http::problem(record.error());
  co_return command_response(*record);
}

namespace {

// What a page must say to begin to control, and may not ask for: it keeps control by signs of life.
Result<void> check_sight(const http::Request& request, ParsedControl& parsed, runtime::Clock& clock) {
  const identity::Caller& caller = request.caller;
  station::ControlRequest& control_request = parsed.request;
  if (control_request.action != station::ControlAction::take && control_request.action != station::ControlAction::force)
    return {};
  control_request.age = request.unread;
  if (auto said = check_stamp(caller, parsed.stamp_us); !said) return said;
  if (caller.session != 0 && control_request.lease > station::kControlLease) {
    return fail(ErrorCode::invalid,
                fmt::format("lease_ms of a page is at most {}", station::kControlLease.count() / 1000), "out_of_range");
  }
  if (!parsed.stamp_us) return {};
  const auto age = age_of_stamp(*parsed.stamp_us, clock);
  if (!age) return std::unexpected{age.error()};
  control_request.age = std::max(control_request.age, *age);
  return {};
}

http::Answer change_control(CommandRoutes parts, http::Request request) {
  auto parsed = parse_control(request.body);
  if (!parsed) co_return refused(parts, request, "control", parsed.error());
  station::ControlRequest& control_request = parsed->request;
  control_request.robot_id = request.param.at("robot_id");
  control_request.actor = request.actor;
  control_request.client = request.caller.client;
  control_request.peer = request.peer;
  // SAFETY: nobody but an admin takes control out of another's hands.
  if (control_request.action == station::ControlAction::force && !request.caller.scopes.allow(identity::Scope::admin)) {
    const Error error{ErrorCode::forbidden, "to take control by force needs the role admin", "not_permitted"};
    co_return refused(parts, request, "control", error);
  }
  if (auto seen = check_sight(request, *parsed, parts.clock); !seen) {
    co_return refused(parts, request, "control", seen.error());
  }
  const auto control = parts.station.control(control_request);
  if (!control) co_return http::problem(control.error());
  co_return http::json_response(200, {{"control", control->holder.empty() ? json(nullptr) : to_json(*control)}});
}

// An acknowledged stop is in force and answered at once; one that is kept must outlive whatever happens after the
// answer, so it is on disk first.
int stop_status(const station::CommandRecord& record) { return was_accepted(record.state) ? 200 : 202; }

constexpr const char* kStopNotStored =
    "the stop is kept and goes to the robot before anything else, but the station's disk does not take it: if the "
    "station ends before it can be stored, it is lost. Keep the station running, do what GET /api/v1/recording says, "
    "stop again";

// SAFETY: a key that is none does not keep a stop from being carried out.
station::StopRequest stop_request(const http::Request& request) {
  station::StopRequest stop;
  stop.actor = request.actor;
  stop.peer = request.peer;
  stop.received_us = request.received_us;
  if (auto key = key_of(request)) stop.key = std::move(*key);
  return stop;
}

http::Answer emergency_stop(CommandRoutes parts, http::Request request) {
  station::StopRequest stop = stop_request(request);
  stop.robot_id = request.param.at("robot_id");
  const auto record = co_await stop_robot(parts.station, std::move(stop));
  if (!record) co_return http::problem(record.error());
  const int status = stop_status(*record);
  const bool is_stored = status != 202 || co_await parts.history.settle();
  if (!is_stored) co_return http::problem(503, kStopNotStored, "not_stored", {{"command", to_json(*record)}});
  co_return http::json_response(status, to_json(*record));
}

http::Answer emergency_stop_all(CommandRoutes parts, http::Request request) {
  const station::StopsOfAll stops = co_await stop_all_robots(parts.station, stop_request(request));
  int status = 200;
  for (const station::CommandRecord& record : stops.records) status = std::max(status, stop_status(record));
  const bool is_stored = status != 202 || co_await parts.history.settle();
  nlohmann::ordered_json body;
  body["summary"] = stop_summary(parts.station, stops);  // first, for people who read it
  body["commands"] = list_json("commands", stops.records)["commands"];
  if (!stops.failed.empty()) {
    const std::string named = fmt::format("{}", fmt::join(stops.failed | std::views::take(kMaxNamedRobots), ", "));
    co_return http::problem(500, fmt::format("the stop of {} failed; the log says why", named), "internal", json(body));
  }
  if (!is_stored) co_return http::problem(503, kStopNotStored, "not_stored", json(body));
  co_return http::json_text_response(status, body.dump());
}

http::Answer list_commands(CommandRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  if (parts.station.find(id) == nullptr) co_return unknown_robot(id);
  const auto filter = query_record_filter(request);
  if (!filter) co_return http::problem(filter.error());
  const auto page = co_await parts.history.commands(id, *filter);
  json body = list_json("commands", page.records);
  body["next"] = page.next ? json(cursor_text(*page.next)) : json(nullptr);
  co_return http::json_response(200, body);
}

// A token that may stop and not read sees its own stops, and one that no robot has acknowledged yet: it may be the
// answer to its own.
bool may_see(const station::CommandRecord& command, const http::Request& request, const station::Station& station) {
  if (request.caller.scopes.allow(identity::Scope::read)) return true;
  if (command.kind != "emergency_stop") return false;
  const station::RobotState* robot = station.find(command.robot_id);
  return command.actor == request.actor || (robot != nullptr && robot->pending_stop == command.id);
}

http::Answer get_command(CommandRoutes parts, http::Request request) {
  const auto id = parse_id(request.param.at("command_id"));
  if (!id) co_return http::problem(400, "command_id is not a decimal number from 1", "out_of_range");
  const auto record = co_await parts.history.command(*id);
  if (!record) co_return http::problem(record.error());
  if (!may_see(*record, request, parts.station)) co_return http::not_permitted(request.caller, identity::Scope::read);
  co_return http::json_response(200, to_json(*record));
}

}  // namespace

void add_command_routes(http::Router& router, CommandRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    std::vector<std::string> query,
                                    http::Answer (*answer)(CommandRoutes, http::Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  add("GET", "/api/v1/robots/{robot_id}/commands", identity::Scope::read,
      {"limit", "before", "from_us", "to_us", "renewals"}, list_commands);
  add("POST", "/api/v1/robots/{robot_id}/commands", identity::Scope::command, {"wait"}, submit_command);
  add("POST", "/api/v1/robots/{robot_id}/control", identity::Scope::command, {}, change_control);
  add("GET", "/api/v1/commands/{command_id}", identity::Scope::look, {}, get_command);
  const auto add_stop = [&router, parts](const char* pattern, http::Answer (*answer)(CommandRoutes, http::Request)) {
    auto stop = with(parts, answer);
    router.add({.method = "POST",
                .pattern = pattern,
                .needs = identity::Scope::stop,
                .query = {},
                .answer = std::move(stop),
                .is_stop = true});
  };
  add_stop("/api/v1/robots/{robot_id}/emergency-stop", emergency_stop);
  add_stop("/api/v1/emergency-stop", emergency_stop_all);
}

}  // namespace server::api
