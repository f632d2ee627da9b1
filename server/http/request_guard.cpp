// The checks that stand in front of every route.
#include "server/http/request_guard.hpp"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cctype>

#include "server/http/router.hpp"

namespace server::http {
namespace asio = boost::asio;

namespace {

constexpr const char* kLoginPath = "/api/v1/login";

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// "localhost:8080" and "[::1]:8080" without the port and the brackets.
std::string host_name(const std::string& host) {
  if (!host.empty() && host.front() == '[') {
    const auto end = host.find(']');
    return end == std::string::npos ? "" : host.substr(1, end - 1);
  }
  return host.substr(0, host.find(':'));
}

bool changes_something(const Request& request) {
  return request.method != "GET" && request.method != "HEAD" && request.method != "OPTIONS";
}

std::unexpected<Response> refuse(int status, const char* detail, const char* reason) {
  return std::unexpected<Response>{problem(status, detail, reason)};
}

// `challenge`: as RFC 6750 has it.
std::unexpected<Response> not_authenticated(const char* detail, const char* reason, const char* challenge) {
  Response response = problem(401, detail, reason);
  response.headers.emplace_back("WWW-Authenticate", challenge);
  return std::unexpected<Response>{std::move(response)};
}

// What is wrong with the body's type or its coding, if there is one. What a form of another page can send is no JSON.
std::optional<std::unexpected<Response>> refusal_of_body(const Request& request, bool has_body) {
  if (!has_body) return std::nullopt;
  const std::string content_type = lower(request.header("content-type"));
  if (content_type.substr(0, content_type.find(';')) != "application/json") {
    return refuse(415, "the body must be application/json", "wrong_content_type");
  }
  const std::string coding = lower(request.header("content-encoding"));
  if (coding.empty() || coding == "identity") return std::nullopt;
  return refuse(415, "the body must be sent without Content-Encoding", "wrong_content_encoding");
}

}  // namespace

std::string cookie_value(const std::string& header, const std::string& name) {
  std::size_t begin = 0;
  while (begin < header.size()) {
    const auto end = std::min(header.find(';', begin), header.size());
    const auto first = header.find_first_not_of(' ', begin);
    if (first < end && header.compare(first, name.size() + 1, name + "=") == 0) {
      return header.substr(first + name.size() + 1, end - first - name.size() - 1);
    }
    begin = end + 1;
  }
  return {};
}

RequestGuard::RequestGuard(identity::Auth& auth, std::vector<std::string> hosts, bool is_secure)
    : auth_{auth}, hosts_{std::move(hosts)}, scheme_{is_secure ? "https://" : "http://"} {
  std::ranges::transform(hosts_, hosts_.begin(), lower);
}

bool RequestGuard::host_is_ours(const std::string& host) const {
  const std::string name = lower(host_name(host));
  if (name == "localhost" || std::ranges::find(hosts_, name) != hosts_.end()) return true;
  boost::system::error_code error;
  const auto address = asio::ip::make_address(name, error);
  return !error && address.is_loopback();
}

std::expected<RequestGuard::Credential, Response> RequestGuard::credential_of(const Request& request) const {
  const std::string authorization = request.header("authorization");
  if (!authorization.empty()) {  // a wrong token is not made good by a cookie
    constexpr std::size_t kSchemeLength = 7;
    if (lower(authorization.substr(0, kSchemeLength)) != "bearer ") {
      return not_authenticated("the header Authorization has another scheme than Bearer; send 'Bearer <token>'",
                               "no_credential", "Bearer");
    }
    auto caller = auth_.caller_of_token(authorization.substr(kSchemeLength));
    if (caller) return Credential{std::move(*caller), false};
    return not_authenticated("the token is none of this station, was revoked or has expired; make another one",
                             "wrong_token", R"(Bearer error="invalid_token")");
  }
  const std::string cookies = request.header("cookie");
  auto caller = auth_.caller_of_session(cookie_value(cookies, auth_.cookie_name()));
  if (caller) return Credential{std::move(*caller), true};
  return not_authenticated("sign in, open the link that the station printed, or send a token as Bearer",
                           "no_credential", "Bearer");
}

std::expected<identity::Caller, Response> RequestGuard::admit(const Request& request) const {
  return admit(request, !request.body.empty());
}

std::expected<identity::Caller, Response> RequestGuard::admit(const Request& request, bool has_body) const {
  const std::string host = request.header("host");
  if (!host_is_ours(host)) {
    return refuse(421, "this station does not answer to that Host; add the name to http.hosts in its configuration",
                  "wrong_host");
  }
  const std::string& path = request.target.path();
  if (!request.target.is_acceptable()) return refuse(400, "the path is not acceptable", "malformed_path");
  const bool live = path == "/live";
  const std::string origin = request.header("origin");
  const bool same_origin = lower(origin) == scheme_ + lower(host);
  if (!origin.empty() && !same_origin && (live || changes_something(request))) {
    return refuse(403, "the request comes from a page of another origin", "wrong_origin");
  }
  const bool holds_data = live || path == "/metrics" || path.starts_with("/api/");
  if (!holds_data && !changes_something(request)) return identity::Caller{};
  if (request.method == "POST" && path == kLoginPath) {
    if (auto refusal = refusal_of_body(request, has_body)) return std::move(*refusal);
    return identity::Caller{};
  }

  auto credential = credential_of(request);
  if (!credential) return std::unexpected<Response>{std::move(credential.error())};
  if (credential->by_cookie && changes_something(request) && !same_origin &&
      (!origin.empty() || request.header("sec-fetch-site") != "same-origin")) {
    return refuse(403, "a request by cookie must say that it comes from the station's own page (Origin)",
                  "wrong_origin");
  }
  if (auto refusal = refusal_of_body(request, has_body)) return std::move(*refusal);
  if (live && !credential->caller.scopes.allow(identity::Scope::read)) {
    return std::unexpected{not_permitted(credential->caller, identity::Scope::read)};
  }
  return std::move(credential->caller);
}

}  // namespace server::http
