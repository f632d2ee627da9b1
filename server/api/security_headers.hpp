// What every answer tells a browser about how it may be used, errors included.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/api/http.hpp"

namespace server {

// The names are those of RFC 9110 and of the W3C. `host` is the request's Host, which the policy names as the origin of
// /live when it is a plain name and port; `is_secure`: the connection is TLS.
std::vector<std::pair<const char*, std::string>> security_headers(const std::string& host, bool is_secure);

// A whole answer as bytes, after which the connection ends: for those who did not get as far as a request.
std::string last_answer(const Response& response, bool is_secure);

}  // namespace server
