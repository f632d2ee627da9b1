// Signing in and out, users, API tokens, sessions, and the enrolment of robots.
//
// A secret stands in one answer only, that of the request which made it.
#include <fmt/format.h>

#include "server/api/bodies/limits.hpp"
#include "server/api/routes/routes.hpp"
#include "server/identity/auth.hpp"
#include "server/identity/logins.hpp"
#include "server/station/station.hpp"

namespace server {
using nlohmann::json;

namespace {

// ---- signing in and out

Response login_refused(const LoginRefusal& refusal) {
  Response response = problem(refusal.error);
  if (refusal.retry_after.count() == 0) return response;
  response = problem(429, refusal.error.detail, refusal.error.reason);
  const std::int64_t seconds = (refusal.retry_after.count() + 999'999) / 1'000'000;
  response.headers.emplace_back("Retry-After", std::to_string(seconds));
  return response;
}

json me_json(const std::string& user, const std::string& actor, Scopes scopes) {
  return {{"actor", actor}, {"user", user}, {"role", text(scopes.role())}, {"scopes", text(scopes)}};
}

Answer log_in(AccountRoutes parts, Request request) {
  const auto body = Members::parse(request.body, {"user", "password"});
  if (!body) co_return problem(body.error());
  const auto user = body->text("user", text_bytes("LoginBody.user"));
  if (!user) co_return problem(user.error());
  const auto password = body->text("password", text_bytes("LoginBody.password"));
  if (!password) co_return problem(password.error());
  LoginAttempt attempt{*user, *password, request.peer, request.header("user-agent")};
  const auto secret = co_await parts.logins.log_in(std::move(attempt));
  if (!secret) co_return login_refused(secret.error());
  const auto caller = parts.auth.caller_of_session(*secret);
  if (!caller) co_return problem(401, "the user was removed just now", "wrong_credentials");
  Response response = json_response(200, me_json(caller->user, caller->actor, caller->scopes));
  response.headers.emplace_back("Set-Cookie", parts.auth.cookie(*secret, parts.facts.is_secure()));
  co_return response;
}

Answer log_out(AccountRoutes parts, Request request) {
  if (request.caller.session == 0) {
    co_return problem(409, "a token has no session; revoke the token instead", "no_session");
  }
  parts.accounts.end_session(request.caller.session, author_of(request, parts.clock));
  Response response = json_response(200, json::object());
  response.headers.emplace_back("Set-Cookie", parts.auth.cookie("", parts.facts.is_secure()));
  co_return response;
}

Answer get_me(AccountRoutes, Request request) {
  const Caller& caller = request.caller;
  co_return json_response(200, me_json(caller.user, caller.actor, caller.scopes));
}

// ---- users

Answer list_users(AccountRoutes parts, Request) {
  json list = json::array();
  for (const auto& [name, user] : parts.accounts.users()) list.push_back(to_json(user));
  co_return json_response(200, {{"users", std::move(list)}});
}

Answer add_user(AccountRoutes parts, Request request) {
  const auto body = Members::parse(request.body, {"name", "role", "password"});
  if (!body) co_return problem(body.error());
  const auto name = body->text("name", {0, kMaxWordBytes});
  if (!name) co_return problem(name.error());
  if (const auto checked = check_name(*name); !checked) co_return problem(checked.error());
  const auto word = body->text("role", {0, kMaxWordBytes});
  if (!word) co_return problem(word.error());
  const auto role = parse_role(*word);
  if (!role) co_return problem(role.error());
  const auto password = body->text("password", text_bytes("UserBody.password"));
  if (!password) co_return problem(password.error());
  auto hash = co_await parts.logins.hash(*password);
  if (!hash) co_return problem(hash.error());
  User user;
  user.name = *name;
  user.role = *role;
  user.password_hash = std::move(*hash);
  const auto added = co_await parts.accounts.add_user(std::move(user), author_of(request, parts.clock));
  if (!added) co_return problem(added.error());
  co_return json_response(201, to_json(*added));
}

Answer change_user(AccountRoutes parts, Request request) {
  const auto body = Members::parse(request.body, {"role", "password", "disabled"});
  if (!body) co_return problem(body.error());
  UserChange change;
  if (body->has("role")) {
    const auto word = body->text("role", {0, kMaxWordBytes});
    if (!word) co_return problem(word.error());
    const auto role = parse_role(*word);
    if (!role) co_return problem(role.error());
    change.role = *role;
  }
  if (body->has("disabled")) {
    const json& value = body->object().at("disabled");
    if (!value.is_boolean()) co_return problem(400, "disabled is neither true nor false", "wrong_type");
    change.disabled = value.get<bool>();
  }
  if (body->has("password")) {
    const auto password = body->text("password", text_bytes("UserChange.password"));
    if (!password) co_return problem(password.error());
    auto hash = co_await parts.logins.hash(*password);
    if (!hash) co_return problem(hash.error());
    change.password_hash = std::move(*hash);
  }
  const std::string name = request.param.at("user");
  const auto changed = co_await parts.accounts.change_user(name, std::move(change), author_of(request, parts.clock));
  if (!changed) co_return problem(changed.error());
  co_return json_response(200, to_json(*changed));
}

Answer remove_user(AccountRoutes parts, Request request) {
  const std::string name = request.param.at("user");
  const auto removed = co_await parts.accounts.remove_user(name, author_of(request, parts.clock));
  if (!removed) co_return problem(removed.error());
  co_return json_response(200, json::object());
}

// ---- API tokens

Answer list_tokens(AccountRoutes parts, Request) {
  co_return json_response(200, list_json("tokens", parts.accounts.tokens()));
}

Answer add_token(AccountRoutes parts, Request request) {
  const auto body = Members::parse(request.body, {"name", "scopes", "days"});
  if (!body) co_return problem(body.error());
  const auto name = body->text("name", {0, kMaxWordBytes});
  if (!name) co_return problem(name.error());
  if (const auto checked = check_name(*name); !checked) co_return problem(checked.error());
  if (*name == "local") co_return problem(422, "local is the name of the station's own token", "out_of_range");
  const auto words = body->text("scopes", text_bytes("ScopeList"));
  if (!words) co_return problem(words.error());
  const auto scopes = parse_scopes(*words);
  if (!scopes) co_return problem(scopes.error());
  TokenRequest token_request{*name, *scopes, 0, request.caller.user};
  if (body->has("days")) {
    const auto days = body->integer("days", integers("TokenBody.days"));
    if (!days) co_return problem(days.error());
    token_request.days = *days;
  }
  const auto made = co_await parts.accounts.add_token(std::move(token_request), author_of(request, parts.clock));
  if (!made) co_return problem(made.error());
  json answer = to_json(made->token);
  answer["secret"] = made->secret;
  co_return json_response(201, answer);
}

Answer revoke_token(AccountRoutes parts, Request request) {
  const std::string name = request.param.at("token");
  const auto revoked = co_await parts.accounts.revoke_token(name, author_of(request, parts.clock));
  if (!revoked) co_return problem(revoked.error());
  co_return json_response(200, to_json(*revoked));
}

// ---- sessions of pages

Answer list_sessions(AccountRoutes parts, Request request) {
  json list = json::array();
  for (const Sessions::Open& session : parts.accounts.sessions()) {
    json entry = to_json(static_cast<const PageSession&>(session));
    entry["is_mine"] = session.number == request.caller.session;
    list.push_back(std::move(entry));
  }
  co_return json_response(200, {{"sessions", std::move(list)}});
}

Answer revoke_session(AccountRoutes parts, Request request) {
  const auto number = parse_id(request.param.at("session"));
  if (!number || !parts.accounts.end_session(*number, author_of(request, parts.clock))) {
    co_return problem(404, "there is no such session", "unknown_session");
  }
  co_return json_response(200, json::object());
}

// ---- robots

Answer list_enrolments(AccountRoutes parts, Request) {
  const auto enrolments = co_await parts.accounts.enrolments();
  if (!enrolments) co_return problem(enrolments.error());
  co_return json_response(200, list_json("enrolments", *enrolments));
}

Answer enrol_robot(AccountRoutes parts, Request request) {
  const auto body = Members::parse(request.body, {"robot_id"});
  if (!body) co_return problem(body.error());
  const auto robot_id = body->text("robot_id", {0, kMaxWordBytes});
  if (!robot_id) co_return problem(robot_id.error());
  if (!is_robot_id(*robot_id)) {
    co_return problem(422, "robot_id is not 1 to 31 characters of [a-z0-9_-]", "out_of_range");
  }
  const auto made = co_await parts.accounts.enrol(*robot_id, author_of(request, parts.clock));
  if (!made) co_return problem(made.error());
  if (parts.station.find(*robot_id) == nullptr) {
    parts.station.restore({RestoredRobot{*robot_id}}, {});  // people see it, and who else uses its name
  }
  parts.station.end_connection(*robot_id, "it was enrolled with a new token");
  json answer = to_json(made->enrolment);
  answer["secret"] = made->secret;
  co_return json_response(201, answer);
}

// The connection ends whether or not the disk can store why; one that is being admitted is refused by the recorder.
Answer revoke_robot(AccountRoutes parts, Request request) {
  const std::string robot_id = request.param.at("robot_id");
  parts.station.end_connection(robot_id, "its enrolment was revoked");
  const auto revoked = co_await parts.accounts.revoke_robot(robot_id, author_of(request, parts.clock));
  if (!revoked) co_return problem(revoked.error());
  co_return json_response(200, to_json(*revoked));
}

// SAFETY: what takes a robot out of the stop of all is stored before it is in force; what brings it back is in force at
// once.
Answer retire_robot(AccountRoutes parts, Request request) {
  const auto body = Members::parse(request.body, {"retired"});
  if (!body) co_return problem(body.error());
  if (!body->has("retired")) co_return problem(400, "retired is missing", "missing_member");
  const json& value = body->object().at("retired");
  if (!value.is_boolean()) co_return problem(400, "retired is neither true nor false", "wrong_type");
  const bool retired = value.get<bool>();
  const std::string robot_id = request.param.at("robot_id");
  if (!retired) parts.station.set_retired(robot_id, 0, request.actor);
  const auto stored = co_await parts.accounts.set_retired(robot_id, retired, author_of(request, parts.clock));
  if (!stored) co_return problem(stored.error());
  parts.station.set_retired(robot_id, stored->retired_at_us, request.actor);
  co_return json_response(200, to_json(*stored));
}

}  // namespace

void add_account_routes(Router& router, AccountRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, Scope needs,
                                    Answer (*answer)(AccountRoutes, Request)) {
    router.add({method, pattern, needs, {}, with(parts, answer)});
  };
  add("POST", "/api/v1/login", Scope::anyone, log_in);
  add("POST", "/api/v1/logout", Scope::read, log_out);
  add("GET", "/api/v1/me", Scope::read, get_me);
  add("GET", "/api/v1/users", Scope::admin, list_users);
  add("POST", "/api/v1/users", Scope::admin, add_user);
  add("POST", "/api/v1/users/{user}/change", Scope::admin, change_user);
  add("POST", "/api/v1/users/{user}/remove", Scope::admin, remove_user);
  add("GET", "/api/v1/tokens", Scope::admin, list_tokens);
  add("POST", "/api/v1/tokens", Scope::admin, add_token);
  add("POST", "/api/v1/tokens/{token}/revoke", Scope::admin, revoke_token);
  add("GET", "/api/v1/sessions", Scope::admin, list_sessions);
  add("POST", "/api/v1/sessions/{session}/revoke", Scope::admin, revoke_session);
  add("GET", "/api/v1/enrolments", Scope::admin, list_enrolments);
  add("POST", "/api/v1/enrolments", Scope::admin, enrol_robot);
  add("POST", "/api/v1/enrolments/{robot_id}/revoke", Scope::admin, revoke_robot);
  add("POST", "/api/v1/robots/{robot_id}/retire", Scope::admin, retire_robot);
}

}  // namespace server
