// Emergency stops and lease renewals from pages.
#include "server/api/live_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/emergency.hpp"
#include "server/http/http.hpp"
#include "server/runtime/worker.hpp"
#include "server/station/commands/recent_commands.hpp"

namespace server::api {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

// A renewal that waited longer is worth nothing: the lease it would extend has lapsed.
constexpr microseconds kRenewalTimeToLive{protocol::kLeaseMs * 1000};

asio::awaitable<void> stop_one(LiveParts& parts, station::StopRequest request) {
  co_await stop_robot(parts.station, std::move(request));
}

asio::awaitable<void> stop_all(LiveParts& parts, station::StopRequest request) {
  co_await stop_all_robots(parts.station, std::move(request));
}

asio::awaitable<void> renew(LiveParts& parts, station::CommandRequest request) {
  const runtime::Counted counted{parts.renewals};
  co_await parts.station.submit(std::move(request));
}

// What a message begins goes on by itself, and fails alone.
void spawn(LiveParts& parts, const std::string& name, asio::awaitable<void> task) {
  parts.tasks.spawn(name,
                    contained(parts.tasks.exceptions(), parts.clock, runtime::Ended::request, name, std::move(task)));
}

Result<station::RobotId> known_robot(const Members& message, const LiveParts& parts) {
  auto id = message.text("robot_id", {0, 100});
  if (!id) return id;
  if (parts.station.find(*id) != nullptr) return id;
  return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", *id), "unknown_robot");
}

Result<void> on_emergency_stop(const Members& message, const identity::Caller& caller, LiveParts& parts) {
  station::StopRequest request;
  request.actor = caller.actor;
  request.peer = caller.peer;
  request.received_us = parts.clock.steady_us();
  // SAFETY: a stop is obeyed also when the message carries members that nobody knows, or a key that is none.
  if (const auto key = message.text("key", {1, 64}); key && station::is_command_key(*key)) request.key = *key;
  if (message.has("robot_id") && message.object().at("robot_id").is_null()) {
    spawn(parts, "emergency stop of all robots", stop_all(parts, std::move(request)));
    return {};
  }
  auto robot_id = known_robot(message, parts);
  if (!robot_id) return std::unexpected{robot_id.error()};
  request.robot_id = *robot_id;
  spawn(parts, "emergency stop of robot '" + *robot_id + "'", stop_one(parts, std::move(request)));
  return {};
}

// The robots and experiments for which a page gives a sign of life.
struct Kept {
  std::vector<station::RobotId> robots;
  std::vector<std::int64_t> experiments;
};

Result<Kept> parse_kept(const Members& message) {
  const json none = json::array();
  const json& robots = message.has("robots") ? message.object().at("robots") : none;
  const json& experiments = message.has("experiments") ? message.object().at("experiments") : none;
  const auto is_id = [](const json& id) { return id.is_string() && id.get_ref<const std::string&>().size() <= 31; };
  const auto is_number = [](const json& id) { return id.is_number_unsigned() && id.get<std::uint64_t>() <= kMaxRunId; };
  if (!robots.is_array() || robots.size() > kMaxWatched || !std::ranges::all_of(robots, is_id)) {
    return fail(ErrorCode::invalid, fmt::format("robots must be at most {} robot ids", kMaxWatched), "malformed");
  }
  if (!experiments.is_array() || experiments.size() > kMaxKept || !std::ranges::all_of(experiments, is_number)) {
    return fail(ErrorCode::invalid, fmt::format("experiments must be at most {} numbers", kMaxKept), "malformed");
  }
  return Kept{robots.get<std::vector<station::RobotId>>(), experiments.get<std::vector<std::int64_t>>()};
}

// With the latest stamp it keeps what the page names.
Result<void> on_keep_alive(const Members& message, const identity::Caller& caller, LiveParts& parts) {
  if (auto known = message.only({"type", "stamp_us", "robots", "experiments"}); !known) return known;
  const auto kept = parse_kept(message);
  if (!kept) return std::unexpected{kept.error()};
  if (!message.has("stamp_us")) return {};
  const auto stamp_us = message.integer("stamp_us", {0, INT64_MAX});
  if (!stamp_us) return std::unexpected{stamp_us.error()};
  // SAFETY: who may command no more keeps no control, and nothing moves in their name.
  if (!caller.scopes.allow(identity::Scope::command)) return {};
  const station::Client client{caller.actor, caller.client};
  const microseconds age{parts.clock.steady_us() - *stamp_us};
  for (const station::RobotId& robot : kept->robots) parts.station.keep_control(client, robot, age);
  for (const std::int64_t id : kept->experiments) parts.keep_experiment(id, client, age);
  if (client.id.empty()) parts.station.keep_control(client, std::nullopt, age);
  return {};
}

Result<void> on_renew_lease(const Members& message, const identity::Caller& caller, LiveParts& parts) {
  if (auto known = message.only({"type", "robot_id", "stamp_us"}); !known) return known;
  const auto robot_id = known_robot(message, parts);
  if (!robot_id) return std::unexpected{robot_id.error()};
  const auto stamp_us = message.integer("stamp_us", {0, INT64_MAX});
  if (!stamp_us) return std::unexpected{stamp_us.error()};
  // SAFETY: what the page saw is too old, so its operator may be looking at a robot that has moved on.
  const std::int64_t age_us = parts.clock.steady_us() - *stamp_us;
  if (age_us > station::kOldestSight.count() || age_us < 0) {
    return fail(ErrorCode::conflict, fmt::format("the stamp is {} ms old; at most 400 renew a lease", age_us / 1000),
                "stale");
  }
  if (parts.renewals >= kMaxRenewals) return fail(ErrorCode::unavailable, "too many renewals are on their way", "busy");
  station::CommandRequest request;
  request.robot_id = *robot_id;
  request.action = rheonaut_Command_init_zero;
  request.action.which_action = rheonaut_Command_renew_lease_tag;
  request.actor = caller.actor;
  request.client = caller.client;
  request.peer = caller.peer;
  request.time_to_live = kRenewalTimeToLive - microseconds{age_us};
  spawn(parts, "lease renewal of robot '" + *robot_id + "'", renew(parts, std::move(request)));
  return {};
}

// What the page has sent with its latest stamp comes back at once, so that it measures the way there and back.
Result<void> on_echo(const Members& message, live::Subscriber& page) {
  if (auto known = message.only({"type", "stamp_us"}); !known) return known;
  const auto stamp_us = message.integer("stamp_us", {0, INT64_MAX});
  if (!stamp_us) return std::unexpected{stamp_us.error()};
  page.push(std::make_shared<const std::string>(base::dump({{"type", "echo"}, {"stamp_us", *stamp_us}})), true);
  return {};
}

// A robot that is not known may come yet.
Result<void> on_watch(const Members& message, live::Subscriber& page, LiveParts& parts) {
  if (auto known = message.only({"type", "robots"}); !known) return known;
  const json robots = message.has("robots") ? message.object().at("robots") : json();
  const auto is_id = [](const json& id) { return id.is_string() && id.get_ref<const std::string&>().size() <= 31; };
  if (!robots.is_array() || robots.size() > kMaxWatched || !std::ranges::all_of(robots, is_id)) {
    return fail(ErrorCode::invalid, fmt::format("robots must be at most {} robot ids", kMaxWatched), "malformed");
  }
  const auto watched = robots.get<std::set<station::RobotId>>();
  parts.live.watch(page, watched);
  for (const station::RobotId& id :
       watched) {  // published again with the next stamp, since the page has not received all of it
    if (const station::RobotState* robot = parts.station.find(id)) parts.live.on_robot(*robot);
  }
  return {};
}

}  // namespace

live::RobotDocument welcome_message(const identity::Caller& caller, const LiveParts& parts) {
  json message;
  message["type"] = "welcome";
  message["actor"] = caller.actor;
  if (!caller.client.empty()) message["client"] = caller.client;
  message["version"] = parts.version;
  message["utc_us"] = parts.clock.utc_us();
  message["stamp_us"] = parts.clock.steady_us();
  std::string head = base::dump(message);
  head.pop_back();  // the closing brace: the robots follow
  return {parts.texts, head + R"(,"robots":[)", "]}"};
}

Result<void> on_page_message(const std::string& text, const identity::Caller& caller, live::Subscriber& page,
                             LiveParts& parts) {
  const auto message = Members::parse(text, {});
  if (!message) return std::unexpected{message.error()};
  const auto type = message->text("type", {1, 40});
  if (!type) return std::unexpected{type.error()};
  if (*type == "emergency_stop") return on_emergency_stop(*message, caller, parts);
  if (*type == "renew_lease") return on_renew_lease(*message, caller, parts);
  if (*type == "keep_alive") return on_keep_alive(*message, caller, parts);
  if (*type == "echo") return on_echo(*message, page);
  if (*type == "watch") return on_watch(*message, page, parts);
  return fail(ErrorCode::invalid, fmt::format("unknown message type '{}'", *type), "unknown_type");
}

// SAFETY: a stop needs no more than to see the robot; of a type that is not known here, command is needed.
identity::Scope scope_needed_by(const std::string& text) {
  const auto message = Members::parse(text, {});
  const auto type = message ? message->text("type", {0, kMaxMessageBytes}) : std::unexpected{message.error()};
  if (!type) return identity::Scope::read;  // refused for that
  if (*type == "emergency_stop") return identity::Scope::stop;
  const bool is_reading = *type == "keep_alive" || *type == "watch" || *type == "echo";
  return is_reading ? identity::Scope::read : identity::Scope::command;
}

std::string problem_message(const Error& error, identity::Scope needed) {
  const json body = http::problem_json(error, least_role(needed));
  return base::dump({{"type", "problem"}, {"problem", body}});
}

}  // namespace server::api
