// The headers, and the answer to those who get no other.
#include "server/api/security_headers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace server {
namespace {

// Nothing but what the cockpit is made of, from this origin; nothing inline; no frame around it.
std::string content_security_policy(const std::string& live) {
  return "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; font-src 'self'; connect-src "
         "'self'" +
         live + "; base-uri 'none'; form-action 'self'; frame-ancestors 'none'";
}

// What the page asks no browser for.
constexpr const char* kPermissionsPolicy =
    "accelerometer=(), camera=(), display-capture=(), geolocation=(), gyroscope=(), magnetometer=(), microphone=(), "
    "midi=(), payment=(), usb=()";

// A name or IPv4 address with its port, and nothing that would say more in a policy.
bool is_plain(const std::string& host) {
  const auto allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '.' || c == ':'; };
  return !host.empty() && std::ranges::all_of(host, allowed);
}

}  // namespace

std::vector<std::pair<const char*, std::string>> security_headers(const std::string& host, bool is_secure) {
  // Some browsers do not take 'self' for the WebSocket of the same origin.
  const std::string live = is_plain(host) ? fmt::format(" {}://{}", is_secure ? "wss" : "ws", host) : "";
  std::vector<std::pair<const char*, std::string>> headers{
      {"Server", "rheonaut"},
      {"Content-Security-Policy", content_security_policy(live)},
      {"X-Content-Type-Options", "nosniff"},
      {"X-Frame-Options", "DENY"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Opener-Policy", "same-origin"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Permissions-Policy", kPermissionsPolicy},
  };
  // Browsers keep it for the name with all its ports, and other programs of this machine are localhost, too.
  if (is_secure && !host.starts_with("localhost")) {
    headers.emplace_back("Strict-Transport-Security", "max-age=31536000");
  }
  return headers;
}

std::string last_answer(const Response& response, bool is_secure) {
  std::string text = fmt::format("HTTP/1.1 {} {}\r\nConnection: close\r\nContent-Length: {}\r\n", response.status,
                                 reason_phrase(response.status), response.body.size());
  if (!response.content_type.empty()) text += fmt::format("Content-Type: {}\r\n", response.content_type);
  for (const auto& [name, value] : response.headers) text += fmt::format("{}: {}\r\n", name, value);
  for (const auto& [name, value] : security_headers("", is_secure)) text += fmt::format("{}: {}\r\n", name, value);
  return text + "\r\n" + response.body;
}

}  // namespace server
