// Signing in and out, users, API tokens, sessions, and the enrolment of robots.
//
// A secret stands in one answer only, that of the request which made it.
#include <fmt/format.h>

#include "server/api/bodies/limits.hpp"
#include "server/api/routes/routes.hpp"
#include "server/identity/auth.hpp"
#include "server/identity/logins.hpp"
#include "server/station/station.hpp"
#include "server/storage/finalizing/run_finalizer.hpp"

namespace server::api {
using nlohmann::json;

namespace {

// ---- signing in and out

http::Response login_refused(const identity::LoginRefusal& refusal) {
  http::Response response = http::problem(refusal.error);
  if (refusal.retry_after.count() == 0) return response;
  response = http::problem(429, refusal.error.detail, refusal.error.reason);
  const std::int64_t seconds = (refusal.retry_after.count() + 999'999) / 1'000'000;
  response.headers.emplace_back("Retry-After", std::to_string(seconds));
  return response;
}

json me_json(const std::string& user, const std::string& actor, identity::Scopes scopes) {
  return {{"actor", actor}, {"user", user}, {"role", text(scopes.role())}, {"scopes", text(scopes)}};
}

http::Response signed_in(AccountRoutes parts, const std::string& secret) {
  const auto caller = parts.auth.caller_of_session(secret);
  if (!caller) return http::problem(401, "the user was removed just now", "wrong_credentials");
  http::Response response = http::json_response(200, me_json(caller->user, caller->actor, caller->scopes));
  response.headers.emplace_back("Set-Cookie", parts.auth.cookie(secret, parts.facts.is_secure()));
  return response;
}

http::Response redeem_link(AccountRoutes parts, const http::Request& request, const Members& body) {
  if (const auto alone = body.only({"code"}); !alone) return http::problem(alone.error());
  const auto code = body.text("code", {0, kMaxWordBytes});
  if (!code) return http::problem(code.error());
  const auto secret = parts.auth.log_in(*code, request.peer, request.header("user-agent"));
  if (secret) return signed_in(parts, *secret);
  return http::problem(
      401,
      "this link was used already, or is older than 10 minutes: make a new one with rheonaut login-link "
      "on the station's machine",
      "bad_link");
}

http::Answer log_in(AccountRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"user", "password", "code"});
  if (!body) co_return http::problem(body.error());
  if (body->has("code")) co_return redeem_link(parts, request, *body);
  const auto user = body->text("user", text_bytes("LoginBody.user"));
  if (!user) co_return http::problem(user.error());
  const auto password = body->text("password", text_bytes("LoginBody.password"));
  if (!password) co_return http::problem(password.error());
  identity::LoginAttempt attempt{*user, *password, request.peer, request.header("user-agent")};
  const auto secret = co_await parts.logins.log_in(std::move(attempt));
  if (!secret) co_return login_refused(secret.error());
  co_return signed_in(parts, *secret);
}

http::Answer log_out(AccountRoutes parts, http::Request request) {
  if (request.caller.session == 0) {
    co_return http::problem(409, "a token has no session; revoke the token instead", "no_session");
  }
  const auto ended = co_await parts.accounts.end_session(request.caller.session, author_of(request, parts.clock));
  http::Response response = ended ? http::json_response(200, json::object()) : http::problem(ended.error());
  response.headers.emplace_back("Set-Cookie", parts.auth.cookie("", parts.facts.is_secure()));
  co_return response;
}

http::Answer get_me(AccountRoutes, http::Request request) {
  const identity::Caller& caller = request.caller;
  co_return http::json_response(200, me_json(caller.user, caller.actor, caller.scopes));
}

// ---- users

http::Answer list_users(AccountRoutes parts, http::Request) {
  json list = json::array();
  for (const auto& [name, user] : parts.accounts.users()) list.push_back(to_json(user));
  co_return http::json_response(200, {{"users", std::move(list)}});
}

http::Answer add_user(AccountRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"name", "role", "password"});
  if (!body) co_return http::problem(body.error());
  const auto name = body->text("name", {0, kMaxWordBytes});
  if (!name) co_return http::problem(name.error());
  if (const auto checked = identity::check_name(*name); !checked) co_return http::problem(checked.error());
  const auto word = body->text("role", {0, kMaxWordBytes});
  if (!word) co_return http::problem(word.error());
  const auto role = identity::parse_role(*word);
  if (!role) co_return http::problem(role.error());
  const auto password = body->text("password", text_bytes("UserBody.password"));
  if (!password) co_return http::problem(password.error());
  auto hash = co_await parts.logins.hash(*password);
  if (!hash) co_return http::problem(hash.error());
  identity::User user;
  user.name = *name;
  user.role = *role;
  user.password_hash = std::move(*hash);
  const auto added = co_await parts.accounts.add_user(std::move(user), author_of(request, parts.clock));
  if (!added) co_return http::problem(added.error());
  co_return http::json_response(201, to_json(*added));
}

http::Answer change_user(AccountRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"role", "password", "disabled"});
  if (!body) co_return http::problem(body.error());
  identity::UserChange change;
  if (body->has("role")) {
    const auto word = body->text("role", {0, kMaxWordBytes});
    if (!word) co_return http::problem(word.error());
    const auto role = identity::parse_role(*word);
    if (!role) co_return http::problem(role.error());
    change.role = *role;
  }
  if (body->has("disabled")) {
    const json& value = body->object().at("disabled");
    if (!value.is_boolean()) co_return http::problem(400, "disabled is neither true nor false", "wrong_type");
    change.disabled = value.get<bool>();
  }
  if (body->has("password")) {
    const auto password = body->text("password", text_bytes("UserChange.password"));
    if (!password) co_return http::problem(password.error());
    auto hash = co_await parts.logins.hash(*password);
    if (!hash) co_return http::problem(hash.error());
    change.password_hash = std::move(*hash);
  }
  const std::string name = request.param.at("user");
  const auto changed = co_await parts.accounts.change_user(name, std::move(change), author_of(request, parts.clock));
  if (!changed) co_return http::problem(changed.error());
  co_return http::json_response(200, to_json(*changed));
}

http::Answer remove_user(AccountRoutes parts, http::Request request) {
  const std::string name = request.param.at("user");
  const auto removed = co_await parts.accounts.remove_user(name, author_of(request, parts.clock));
  if (!removed) co_return http::problem(removed.error());
  co_return http::json_response(200, json::object());
}

// ---- API tokens

http::Answer list_tokens(AccountRoutes parts, http::Request) {
  co_return http::json_response(200, list_json("tokens", parts.accounts.tokens()));
}

http::Answer add_token(AccountRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"name", "scopes", "days"});
  if (!body) co_return http::problem(body.error());
  const auto name = body->text("name", {0, kMaxWordBytes});
  if (!name) co_return http::problem(name.error());
  if (const auto checked = identity::check_name(*name); !checked) co_return http::problem(checked.error());
  if (*name == "local") co_return http::problem(422, "local is the name of the station's own token", "out_of_range");
  const auto words = body->text("scopes", text_bytes("ScopeList"));
  if (!words) co_return http::problem(words.error());
  const auto scopes = identity::parse_scopes(*words);
  if (!scopes) co_return http::problem(scopes.error());
  identity::TokenRequest token_request{*name, *scopes, 0, request.caller.user};
  if (body->has("days")) {
    const auto days = body->integer("days", integers("TokenBody.days"));
    if (!days) co_return http::problem(days.error());
    token_request.days = *days;
  }
  const auto made = co_await parts.accounts.add_token(std::move(token_request), author_of(request, parts.clock));
  if (!made) co_return http::problem(made.error());
  json answer = to_json(made->token);
  answer["secret"] = made->secret;
  co_return http::json_response(201, answer);
}

http::Answer revoke_token(AccountRoutes parts, http::Request request) {
  const std::string name = request.param.at("token");
  const auto revoked = co_await parts.accounts.revoke_token(name, author_of(request, parts.clock));
  if (!revoked) co_return http::problem(revoked.error());
  co_return http::json_response(200, to_json(*revoked));
}

http::Answer revive_token(AccountRoutes parts, http::Request request) {
  const std::string name = request.param.at("token");
  const auto revived = co_await parts.accounts.revive_token(name, author_of(request, parts.clock));
  if (!revived) co_return http::problem(revived.error());
  co_return http::json_response(200, to_json(*revived));
}

// ---- sessions of pages

http::Answer list_sessions(AccountRoutes parts, http::Request request) {
  json list = json::array();
  for (const identity::Sessions::Open& session : parts.accounts.sessions()) {
    json entry = to_json(static_cast<const identity::PageSession&>(session));
    entry["is_mine"] = session.number == request.caller.session;
    list.push_back(std::move(entry));
  }
  co_return http::json_response(200, {{"sessions", std::move(list)}});
}

http::Answer revoke_session(AccountRoutes parts, http::Request request) {
  const auto number = parse_id(request.param.at("session"));
  if (!number) co_return http::problem(404, "there is no such session", "unknown_session");
  const auto ended = co_await parts.accounts.end_session(*number, author_of(request, parts.clock));
  co_return ended ? http::json_response(200, json::object()) : http::problem(ended.error());
}

// ---- robots

http::Answer list_enrolments(AccountRoutes parts, http::Request) {
  const auto enrolments = co_await parts.accounts.enrolments();
  if (!enrolments) co_return http::problem(enrolments.error());
  co_return http::json_response(200, list_json("enrolments", *enrolments));
}

bool moves(const station::RobotState& robot) {
  const bool is_driven = robot.context.mode == rheonaut_MODE_AUTO || (robot.sample && robot.sample->duty != 0);
  return robot.link == station::LinkState::connected && is_driven;
}

http::Answer enrol_robot(AccountRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"robot_id"});
  if (!body) co_return http::problem(body.error());
  const auto robot_id = body->text("robot_id", {0, kMaxWordBytes});
  if (!robot_id) co_return http::problem(robot_id.error());
  if (!is_robot_id(*robot_id)) {
    co_return http::problem(422, "robot_id is not 1 to 31 characters of [a-z0-9_-]", "out_of_range");
  }
  // SAFETY: the token ends its connection, and with it the way of a stop.
  if (const auto* robot = parts.station.find(*robot_id); robot != nullptr && moves(*robot)) {
    co_return http::problem(409,
                            fmt::format("robot '{}' is connected and driven; a new token ends its connection, and no "
                                        "stop would arrive: bring it to rest first",
                                        *robot_id),
                            "motor_on");
  }
  const auto made = co_await parts.accounts.enrol(*robot_id, author_of(request, parts.clock));
  if (!made) co_return http::problem(made.error());
  if (parts.station.find(*robot_id) == nullptr) {
    parts.station.restore({station::RestoredRobot{*robot_id}}, {});  // people see it, and who else uses its name
  }
  parts.station.end_connection(*robot_id, "it was enrolled with a new token");
  json answer = to_json(made->enrolment);
  answer["secret"] = made->secret;
  co_return http::json_response(201, answer);
}

// The connection ends whether or not the disk can store why; one that is being admitted is refused by the recorder.
http::Answer revoke_robot(AccountRoutes parts, http::Request request) {
  const std::string robot_id = request.param.at("robot_id");
  parts.station.end_connection(robot_id, "its enrolment was revoked");
  const auto revoked = co_await parts.accounts.revoke_robot(robot_id, author_of(request, parts.clock));
  if (!revoked) co_return http::problem(revoked.error());
  const auto given_up = co_await parts.finalizer.give_up_revoked(robot_id, author_of(request, parts.clock));
  json answer = to_json(*revoked);
  answer["samples_given_up"] = given_up ? json(*given_up) : json(nullptr);  // null: as soon as it can be done
  co_return http::json_response(200, answer);
}

// SAFETY: what takes a robot out of the stop of all is stored before it is in force; what brings it back is in force at
// once.
http::Answer retire_robot(AccountRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"retired"});
  if (!body) co_return http::problem(body.error());
  if (!body->has("retired")) co_return http::problem(400, "retired is missing", "missing_member");
  const json& value = body->object().at("retired");
  if (!value.is_boolean()) co_return http::problem(400, "retired is neither true nor false", "wrong_type");
  const bool retired = value.get<bool>();
  const std::string robot_id = request.param.at("robot_id");
  if (!retired) parts.station.set_retired(robot_id, 0, request.actor);
  const auto stored = co_await parts.accounts.set_retired(robot_id, retired, author_of(request, parts.clock));
  if (!stored) co_return http::problem(stored.error());
  parts.station.set_retired(robot_id, stored->retired_at_us, request.actor);
  co_return http::json_response(200, to_json(*stored));
}

}  // namespace

void add_account_routes(http::Router& router, AccountRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    http::Answer (*answer)(AccountRoutes, http::Request)) {
    router.add({method, pattern, needs, {}, with(parts, answer)});
  };
  add("POST", "/api/v1/login", identity::Scope::anyone, log_in);
  add("POST", "/api/v1/logout", identity::Scope::read, log_out);
  add("GET", "/api/v1/me", identity::Scope::read, get_me);
  add("GET", "/api/v1/users", identity::Scope::admin, list_users);
  add("POST", "/api/v1/users", identity::Scope::admin, add_user);
  add("POST", "/api/v1/users/{user}/change", identity::Scope::admin, change_user);
  add("POST", "/api/v1/users/{user}/remove", identity::Scope::admin, remove_user);
  add("GET", "/api/v1/tokens", identity::Scope::admin, list_tokens);
  add("POST", "/api/v1/tokens", identity::Scope::admin, add_token);
  add("POST", "/api/v1/tokens/{token}/revoke", identity::Scope::admin, revoke_token);
  add("POST", "/api/v1/tokens/{token}/revive", identity::Scope::admin, revive_token);
  add("GET", "/api/v1/sessions", identity::Scope::admin, list_sessions);
  add("POST", "/api/v1/sessions/{session}/revoke", identity::Scope::admin, revoke_session);
  add("GET", "/api/v1/enrolments", identity::Scope::admin, list_enrolments);
  add("POST", "/api/v1/enrolments", identity::Scope::admin, enrol_robot);
  add("POST", "/api/v1/enrolments/{robot_id}/revoke", identity::Scope::admin, revoke_robot);
  add("POST", "/api/v1/robots/{robot_id}/retire", identity::Scope::admin, retire_robot);
}

}  // namespace server::api
