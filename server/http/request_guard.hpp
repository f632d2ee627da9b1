// Accepts or refuses a request before any route sees it.
//
// In this order: the Host header names this station (421; keeps out pages that point their own name at this machine);
// a request that changes something, and /live, comes from the station's own page if from a page at all (403);
// everything but signing in and the files of the cockpit, which hold no data, has a credential (401; a wrong token has
// a reason of its own); a request that changes something and rests on the cookie says where it comes from (403); a body
// is JSON (415). What the caller may do is the routes' to say (Router), and of /live it is decided here: its caller may
// see everything (403). /foxglove is let in by its own ticket alone (api/foxglove_routes.hpp), whatever its origin.
// SAFETY: of an emergency stop the body is not given to be judged (HttpConnection), so that a form of another page is
// kept out by the origin alone.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "server/http/http.hpp"
#include "server/identity/auth.hpp"

namespace server::http {

class RequestGuard {
 public:
  // `hosts` are names or addresses without port, besides localhost and the loopback addresses. The station's own page
  // comes from https:// when the port is secure.
  RequestGuard(identity::Auth& auth, std::vector<std::string> hosts, bool is_secure = false);

  // Who asks (nobody where nobody needs to say), or the refusal.
  std::expected<identity::Caller, Response> admit(const Request& request) const;
  // Decides by the head alone; `has_body` says whether a body follows.
  std::expected<identity::Caller, Response> admit(const Request& request, bool has_body) const;

 private:
  struct Credential {
    identity::Caller caller;
    bool by_cookie = false;
  };

  bool host_is_ours(const std::string& host) const;
  std::expected<Credential, Response> credential_of(const Request& request) const;

  identity::Auth& auth_;
  std::vector<std::string> hosts_;
  const char* scheme_;
};

// The value of the first cookie of this name in "a=1; b=2"; empty when there is none.
std::string cookie_value(const std::string& header, const std::string& name);

}  // namespace server::http
