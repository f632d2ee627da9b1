// The head, and the answer to those who get no other.
#include "server/http/answer_head.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <iterator>

namespace server::http {
namespace {

// The policy allows nothing but the files of the cockpit, from this origin; nothing inline; no frame around it. The
// permissions refuse everything that the page does not ask a browser for.
constexpr auto kSecurityFields =
    "Server: rheonaut\r\n"
    "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; font-src "
    "'self'; connect-src 'self'{}; base-uri 'none'; form-action 'self'; frame-ancestors 'none'\r\n"
    "X-Content-Type-Options: nosniff\r\n"
    "X-Frame-Options: DENY\r\n"
    "Referrer-Policy: no-referrer\r\n"
    "Cross-Origin-Opener-Policy: same-origin\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\n"
    "Permissions-Policy: accelerometer=(), camera=(), display-capture=(), geolocation=(), gyroscope=(), "
    "magnetometer=(), microphone=(), midi=(), payment=(), usb=()\r\n";

// A name or IPv4 address with its port, and nothing that would say more in a policy.
bool is_plain(const std::string& host) {
  const auto allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '.' || c == ':'; };
  return !host.empty() && std::ranges::all_of(host, allowed);
}

void append_security(std::string& head, const Framing& framing) {
  // Some browsers do not take 'self' for the WebSocket of the same origin.
  const std::string live =
      is_plain(framing.host) ? fmt::format(" {}://{}", framing.is_secure ? "wss" : "ws", framing.host) : "";
  fmt::format_to(std::back_inserter(head), kSecurityFields, live);
  // Browsers keep it for the name with all its ports, and other programs of this machine are localhost, too.
  if (framing.is_secure && !framing.host.starts_with("localhost")) {
    head += "Strict-Transport-Security: max-age=31536000\r\n";
  }
}

void append_framing(std::string& head, const Response& response, const Framing& framing) {
  if (response.stream != nullptr) {
    if (framing.version >= 11) head += "Transfer-Encoding: chunked\r\n";
  } else if (may_have_body(response.status)) {
    fmt::format_to(std::back_inserter(head), "Content-Length: {}\r\n", response.body.size());
  }
  const bool upgrades = std::ranges::any_of(response.headers, [](const auto& f) { return f.first == "Upgrade"; });
  if (!framing.keep_alive) {
    head += upgrades ? "Connection: close, upgrade\r\n" : "Connection: close\r\n";
  } else if (upgrades) {
    head += "Connection: upgrade\r\n";
  } else if (framing.version < 11) {
    head += "Connection: keep-alive\r\n";
  }
}

}  // namespace

bool may_have_body(int status) { return status >= 200 && status != 204 && status != 304; }

std::string answer_head(const Response& response, const Framing& framing) {
  std::string head;
  head.reserve(1024);
  const auto out = std::back_inserter(head);
  fmt::format_to(out, "HTTP/1.{} {} {}\r\n", framing.version % 10, response.status, reason_phrase(response.status));
  append_framing(head, response, framing);
  if (!response.content_type.empty()) fmt::format_to(out, "Content-Type: {}\r\n", response.content_type);
  bool says_cache_control = false;
  for (const auto& [name, value] : response.headers) {
    says_cache_control = says_cache_control || name == "Cache-Control";
    fmt::format_to(out, "{}: {}\r\n", name, value);
  }
  if (!says_cache_control) head += "Cache-Control: no-store\r\n";
  append_security(head, framing);
  head += "\r\n";
  return head;
}

std::string last_answer(const Response& response, bool is_secure) {
  return answer_head(response, {.is_secure = is_secure}) + response.body;
}

}  // namespace server::http
