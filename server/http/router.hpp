// Finds the route of a request: method and path pattern to a coroutine that answers.
//
//   router.add({"GET", "/api/v1/runs/{run_id}/gaps", Scope::read, {}, list_gaps});
//
// A caller without the route's scope gets 403 before the route sees the request.
// A path is split at '/', then decoded; a segment with a hidden '/', a control character or ".." is refused with 400,
// under /api/ an unknown or repeated query parameter too. An unknown path under /api/ is 404, a known one with another
// method 405 with Allow. HEAD is answered as GET (the server leaves the body out). Every other path goes to the
// fallback. Outside /api/ the query is not judged: supervisors and links add parameters of their own.
// SAFETY: of a request to stop, neither the query nor one slash at the end of the path is judged.
// Loop thread. Routes are added before the first request and outlive every request.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/http/http.hpp"

namespace server::http {

using Answer = boost::asio::awaitable<Response>;

inline constexpr std::size_t kMaxBodyBytes = 64 * 1024;  // of a request, where a route says nothing else

struct Route {
  std::string method;
  std::string pattern;             // "/api/v1/robots/{robot_id}"
  identity::Scope needs;           // no default: every route says it
  std::vector<std::string> query;  // the parameters it knows
  std::function<Answer(Request)> answer;
  bool is_stop = false;  // SAFETY: an emergency stop, which is never refused for its form
  std::size_t max_body_bytes = kMaxBodyBytes;
};

class Router {
 public:
  void add(Route route);
  // Called for each caller that is refused for want of a scope.
  void set_on_refused(std::function<void(const Request&, identity::Scope)> on_refused) {
    on_refused_ = std::move(on_refused);
  }
  void set_fallback(std::function<Response(const Request&)> fallback) { fallback_ = std::move(fallback); }

  // Whether the head alone, of this method and target, is reason enough to act.
  bool is_stop(const std::string& method, const Target& target) const;

  // How long a body may be for it.
  std::size_t max_body_bytes(const std::string& method, const Target& target) const;
  // What the caller would need for it and has not, before a long body is read; on_refused has been called then.
  std::optional<identity::Scope> scope_lacking(const std::string& method, const Target& target,
                                               const identity::Caller& caller) const;

  // A coroutine that throws passes its exception on.
  Answer dispatch(Request request) const;

  const std::vector<Route>& routes() const { return routes_; }
  // Null: there is none. HEAD has the route of GET.
  const Route* find(const std::string& method, const Target& target) const;

 private:
  struct Entry {
    std::vector<std::string> segments;
    std::size_t route = 0;
  };

  bool matches(const Entry& entry, const Target& target) const;

  std::vector<Route> routes_;
  std::vector<Entry> entries_;
  std::function<void(const Request&, identity::Scope)> on_refused_;
  std::function<Response(const Request&)> fallback_;
};

// 403 that says which role is needed.
Response not_permitted(const identity::Caller& caller, identity::Scope needed);

}  // namespace server::http
