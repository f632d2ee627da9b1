// Matches paths, decodes what they carry, and calls the route.
#include "server/http/router.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace server {
namespace asio = boost::asio;

namespace {

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  for (;;) {
    const auto end = text.find(separator);
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

bool is_parameter(const std::string& segment) { return !segment.empty() && segment.front() == '{'; }

Result<std::map<std::string, std::string>> parse_query(std::string_view text, const std::vector<std::string>& known) {
  std::map<std::string, std::string> query;
  if (text.empty()) return query;
  for (const std::string& pair : split(text, '&')) {
    const auto equals = pair.find('=');
    const auto name = percent_decode(pair.substr(0, equals), true);
    const auto value = percent_decode(equals == std::string::npos ? "" : pair.substr(equals + 1), true);
    if (!name || !value) return fail(ErrorCode::bad_request, "the query is not a valid encoding", "malformed_query");
    if (std::ranges::find(known, *name) == known.end()) {
      return fail(ErrorCode::bad_request, fmt::format("query parameter '{}' is not known here", name->substr(0, 40)),
                  "unknown_parameter");
    }
    if (!query.emplace(*name, *value).second) {
      return fail(ErrorCode::bad_request, fmt::format("query parameter '{}' is given twice", *name), "malformed_query");
    }
  }
  return query;
}

}  // namespace

std::optional<std::string> percent_decode(std::string_view text, bool plus_is_space) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '+' && plus_is_space) {
      c = ' ';
    } else if (c == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const int high = hex_value(text[i + 1]);
      const int low = hex_value(text[i + 2]);
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return std::nullopt;
    out += c;
  }
  return out;
}

std::optional<std::vector<std::string>> path_segments(const std::string& target) {
  const std::string_view path = std::string_view{target}.substr(0, target.find('?'));
  if (path.empty() || path.front() != '/') return std::nullopt;
  auto segments = split(path.substr(1), '/');
  for (std::string& segment : segments) {
    auto decoded = percent_decode(segment, false);
    if (!decoded || *decoded == ".." || *decoded == "." || decoded->find_first_of("/\\") != std::string::npos) {
      return std::nullopt;
    }
    segment = std::move(*decoded);
  }
  return segments;
}

std::optional<std::string> path_of(const std::string& target) {
  const auto segments = path_segments(target);
  if (!segments) return std::nullopt;
  std::string path;
  for (const std::string& segment : *segments) path += "/" + segment;
  return path;
}

void Router::add(Route route) {
  entries_.push_back({split(std::string_view{route.pattern}.substr(1), '/'), routes_.size()});
  routes_.push_back(std::move(route));
}

Response not_permitted(const Caller& caller, Scope needed) {
  const char* role = text(least_role(needed));
  std::string detail = fmt::format("this needs the role {} (a token: the scope {}); {} has the role {}", role,
                                   text(needed), caller.actor, text(caller.role()));
  if (caller.session == 0) {
    detail = fmt::format("this needs the scope {} (a person: the role {}); {} has {}", text(needed), role, caller.actor,
                         text(caller.scopes));
  }
  return problem(403, std::move(detail), "not_permitted", {{"needs", role}});
}

bool Router::matches(const Entry& entry, std::span<const std::string> path) const {
  if (routes_[entry.route].is_stop && path.back().empty()) path = path.first(path.size() - 1);
  const auto same = [](const std::string& wanted, const std::string& given) {
    return is_parameter(wanted) ? !given.empty() : wanted == given;
  };
  return std::ranges::equal(entry.segments, path, same);
}

bool Router::is_stop(const std::string& method, const std::string& target) const {
  const auto path = path_segments(target);
  return path && std::ranges::any_of(entries_, [&](const Entry& entry) {
           const Route& route = routes_[entry.route];
           return route.is_stop && route.method == method && matches(entry, *path);
         });
}

const Route* Router::find(const std::string& method, const std::string& target) const {
  const auto path = path_segments(target);
  if (!path) return nullptr;
  for (const Entry& entry : entries_) {
    const Route& route = routes_[entry.route];
    if (route.method == method && matches(entry, *path)) return &route;
  }
  return nullptr;
}

std::size_t Router::max_body_bytes(const std::string& method, const std::string& target) const {
  const Route* route = find(method, target);
  return route == nullptr ? kMaxBodyBytes : route->max_body_bytes;
}

std::optional<Scope> Router::scope_lacking(const std::string& method, const std::string& target,
                                           const Caller& caller) const {
  const Route* route = find(method, target);
  if (route == nullptr || caller.scopes.allow(route->needs)) return std::nullopt;
  Request head;
  head.method = method;
  head.target = target;
  head.path = path_of(target).value_or("");
  head.caller = caller;
  head.actor = caller.actor;
  head.peer = caller.peer;
  if (on_refused_) on_refused_(head, route->needs);
  return route->needs;
}

Answer Router::dispatch(Request request) const {
  const auto question_mark = request.target.find('?');
  const auto path = path_segments(request.target);
  if (!path) co_return problem(400, "the path is not acceptable", "malformed_path");
  request.path = *path_of(request.target);
  const std::string method = request.method == "HEAD" ? "GET" : request.method;

  std::string allowed;
  for (const Entry& entry : entries_) {
    if (!matches(entry, *path)) continue;
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
      if (is_parameter(name)) request.param[name.substr(1, name.size() - 2)] = (*path)[i];
    }
    if (!route.is_stop && question_mark != std::string::npos) {
      auto parsed = parse_query(std::string_view{request.target}.substr(question_mark + 1), route.query);
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
  if (fallback_ && path->front() != "api") co_return fallback_(request);
  co_return problem(404, "there is nothing at this path", "unknown_path");
}

}  // namespace server
