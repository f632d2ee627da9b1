// An HTTP request and its response as plain values, so that routes know nothing of sockets and can be tested without.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/target.hpp"
#include "server/identity/caller.hpp"
#include "server/runtime/result.hpp"

namespace server::http {

struct Request {
  std::string method;                          // "GET", "POST", …
  Target target;                               // as sent: path and query
  std::map<std::string, std::string> headers;  // names in lower case; repeated ones joined by ", " (cookies by "; ")
  std::string body;
  std::int64_t received_us = 0;  // steady, when all of it had arrived; of a stop, its head
  microseconds unread{0};        // the loop stood still: it may have waited for so long before it was read

  std::string peer;                          // the address it came from, without port
  std::string actor;                         // who asks: caller.actor
  identity::Caller caller;                   // and what they may do; set by RequestGuard
  std::string path;                          // decoded; set by Router, as are the two below
  std::map<std::string, std::string> param;  // of the path, decoded
  std::map<std::string, std::string> query;  // decoded

  std::string header(const std::string& name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? std::string{} : found->second;
  }
};

// A body that is made piece by piece while it is sent.
class BodyStream {
 public:
  virtual ~BodyStream() = default;
  // The next piece; empty at the end. A failure ends the connection, since the status was sent already.
  virtual boost::asio::awaitable<Result<std::optional<std::string>>> next() = 0;
};

struct Response {
  int status = 200;
  std::string content_type;
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
  std::unique_ptr<BodyStream> stream;  // instead of body
};

const char* reason_phrase(int status);

// The one table from ErrorCode to HTTP status.
int http_status(ErrorCode code);

Response json_response(int status, const nlohmann::json& body);
Response json_text_response(int status, std::string text);  // text that is JSON already
Response html_response(int status, std::string body);

// Problem details (RFC 9457). `extra` adds members. An error without a reason has that of its code. A 403 has `needs`,
// the least role that may do this; null: no role changes it.
Response problem(int status, std::string detail, std::string reason, nlohmann::json extra = nlohmann::json::object());
Response problem(const Error& error, nlohmann::json extra = nlohmann::json::object());
Response problem(const Error& error, identity::Role needs_if_forbidden);
nlohmann::json problem_json(const Error& error, identity::Role needs_if_forbidden);

}  // namespace server::http
