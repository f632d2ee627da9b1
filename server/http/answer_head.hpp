// The head of an HTTP answer as bytes: status, framing, what the response says of itself, and what every answer, errors
// included, says how a browser may use it. Field names are those of RFC 9110 and of the W3C.
#pragma once

#include <string>

#include "server/http/http.hpp"

namespace server::http {

struct Framing {
  unsigned version = 11;    // of HTTP, as the request said: 10 or 11
  bool keep_alive = false;  // false: the connection ends after the answer
  bool is_secure = false;   // TLS
  std::string host{};       // the request's Host: the origin of /live in the policy when it is a plain name and port
};

// Whether a response of this status is followed by a body at all.
bool may_have_body(int status);

// Up to and with the empty line. Not cached unless the response has a Cache-Control (one, spelt so). A response with a
// stream is chunked in HTTP/1.1; in 1.0 the connection's end is its end, so it may not be kept alive.
std::string answer_head(const Response& response, const Framing& framing);

// A whole answer, after which the connection ends: for those who did not get as far as a request.
std::string last_answer(const Response& response, bool is_secure);

}  // namespace server::http
