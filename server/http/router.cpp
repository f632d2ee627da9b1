// Matches paths, names what they carry, and calls the route.
#include "server/http/router.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace server::http {
namespace asio = boost::asio;

namespace {

bool is_parameter(const std::string& segment) { return !segment.empty() && segment.front() == '{'; }

Result<std::map<std::string, std::string>> query_of(const Target& target, const std::vector<std::string>& known) {
  auto pairs = target.query();
  if (!pairs) return fail(ErrorCode::bad_request, "the query is not a valid encoding", "malformed_query");
  std::map<std::string, std::string> query;
  for (auto& [name, value] : *pairs) {
    if (std::ranges::find(known, name) == known.end()) {
      return fail(ErrorCode::bad_request, fmt::format("query parameter '{}' is not known here", name.substr(0, 40)),
                  "unknown_parameter");
    }
    if (!query.emplace(name, std::move(value)).second) {
      return fail(ErrorCode::bad_request, fmt::format("query parameter '{}' is given twice", name), "malformed_query");
    }
  }
  return query;
}

}  // namespace

void Router::add(Route route) {
  entries_.push_back({split(std::string_view{route.pattern}.substr(1), '/'), routes_.size()});
  routes_.push_back(std::move(route));
}

Response not_permitted(const identity::Caller& caller, identity::Scope needed) {
  const char* role = text(least_role(needed));
  std::string detail = fmt::format("this needs the role {} (a token: the scope {}); {} has the role {}", role,
                                   text(needed), caller.actor, text(caller.role()));
  if (caller.session == 0) {
    detail = fmt::format("this needs the scope {} (a person: the role {}); {} has {}", text(needed), role, caller.actor,
                         text(caller.scopes));
  }
  return problem(403, std::move(detail), "not_permitted", {{"needs", role}});
}

bool Router::matches(const Entry& entry, const Target& target) const {
  if (!target.is_acceptable()) return false;
  std::span<const std::string> path = target.segments();
  if (routes_[entry.route].is_stop && path.back().empty()) path = path.first(path.size() - 1);
  const auto same = [](const std::string& wanted, const std::string& given) {
    return is_parameter(wanted) ? !given.empty() : wanted == given;
  };
  return std::ranges::equal(entry.segments, path, same);
}

bool Router::is_stop(const std::string& method, const Target& target) const {
  return std::ranges::any_of(entries_, [&](const Entry& entry) {
    const Route& route = routes_[entry.route];
    return route.is_stop && route.method == method && matches(entry, target);
  });
}

const Route* Router::find(const std::string& of_request, const Target& target) const {
  const std::string method = of_request == "HEAD" ? "GET" : of_request;
  for (const Entry& entry : entries_) {
    const Route& route = routes_[entry.route];
    if (route.method == method && matches(entry, target)) return &route;
  }
  return nullptr;
}

std::size_t Router::max_body_bytes(const std::string& method, const Target& target) const {
  const Route* route = find(method, target);
  return route == nullptr ? kMaxBodyBytes : route->max_body_bytes;
}

std::optional<identity::Scope> Router::scope_lacking(const std::string& method, const Target& target,
                                                     const identity::Caller& caller) const {
  const Route* route = find(method, target);
  if (route == nullptr || caller.scopes.allow(route->needs)) return std::nullopt;
  Request head;
  head.method = method;
  head.target = target;
  head.path = target.path();
  head.caller = caller;
  head.actor = caller.actor;
  head.peer = caller.peer;
  if (on_refused_) on_refused_(head, route->needs);
  return route->needs;
}

Answer Router::dispatch(Request request) const {
  if (!request.target.is_acceptable()) co_return problem(400, "the path is not acceptable", "malformed_path");
  request.path = request.target.path();
  const bool is_of_api = request.target.segments().front() == "api";
  const std::string method = request.method == "HEAD" ? "GET" : request.method;

  std::string allowed;
  for (const Entry& entry : entries_) {
    if (!matches(entry, request.target)) continue;
    const Route& route = routes_[entry.route];
    if (route.method != method) {
      allowed += (allowed.empty() ? "" : ", ") + route.method + (route.method == "GET" ? ", HEAD" : "");
      continue;
    }
    if (!request.caller.scopes.allow(route.needs)) {
      if (on_refused_) on_refused_(request, route.needs);
      co_return not_permitted(request.caller, route.needs);
    }
    for (std::size_t i = 0; i < entry.segments.size(); ++i) {
      const std::string& name = entry.segments[i];
      if (is_parameter(name)) request.param[name.substr(1, name.size() - 2)] = request.target.segments()[i];
    }
    if (is_of_api && !route.is_stop) {
      auto parsed = query_of(request.target, route.query);
      if (!parsed) co_return problem(parsed.error());
      request.query = std::move(*parsed);
    }
    co_return co_await route.answer(std::move(request));
  }
  if (!allowed.empty()) {
    Response response = problem(405, fmt::format("{} is not possible here", request.method), "method_not_allowed");
    response.headers.emplace_back("Allow", allowed);
    co_return response;
  }
  if (fallback_ && !is_of_api) co_return fallback_(request);
  co_return problem(404, "there is nothing at this path", "unknown_path");
}

}  // namespace server::http
