// Reads Beast's messages and errors as the connection needs them.
#include "server/http/request_reading.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/beast/http/error.hpp>
#include <cctype>
#include <iterator>

#include "server/http/router.hpp"

namespace server::http {
namespace http = boost::beast::http;

Request plain_head(const RequestMessage& message) {
  Request request;
  request.method = message.method_string();
  request.target = Target{std::string{message.target()}};
  for (const auto& field : message) {
    std::string name = field.name_string();
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    std::string& value = request.headers[name];
    if (!value.empty()) value += name == "cookie" ? "; " : ", ";
    value += field.value();
  }
  if (!request.target.authority().empty()) request.headers["host"] = request.target.authority();
  return request;
}

bool has_folded_line(std::string_view head) {
  return head.find("\r\n ") != std::string_view::npos || head.find("\r\n\t") != std::string_view::npos;
}

bool has_two_hosts(const RequestMessage& message) { return message.count(http::field::host) > 1; }

bool has_unknown_length(const RequestParser& parser) {
  return parser.get().count(http::field::transfer_encoding) > 0 && !parser.chunked();
}

bool can_pass_over_body(const RequestParser& parser) {
  const auto& head = parser.get();
  if (!head.keep_alive() || head.version() < 11 || head.count(http::field::expect) > 0) return false;
  return parser.content_length().value_or(0) <= kMaxBodyBytes;
}

HeaderFields::HeaderFields(const RequestParser& parser) {
  if (parser.chunked()) of_chunked_ = parser.get().base();
}

RequestMessage HeaderFields::release(RequestParser& parser) {
  RequestMessage message = parser.release();
  if (of_chunked_) message.base() = std::move(*of_chunked_);
  return message;
}

Response body_too_large(std::size_t limit) {
  return problem(413, fmt::format("the body has more than {} bytes", limit), "too_large");
}

std::optional<Response> header_too_large(const RequestMessage& message) {
  if (message.target().size() > kMaxTargetBytes) {
    return problem(414, fmt::format("the target has more than {} bytes", kMaxTargetBytes), "too_large");
  }
  if (std::distance(message.begin(), message.end()) > static_cast<std::ptrdiff_t>(kMaxHeaderFields)) {
    return problem(431, fmt::format("the header has more than {} fields", kMaxHeaderFields), "too_large");
  }
  return std::nullopt;
}

std::optional<Response> unreadable(boost::system::error_code error) {
  static const auto& http_category = http::make_error_code(http::error::bad_method).category();
  if (error.category() != http_category || error == http::error::end_of_stream ||
      error == http::error::partial_message) {
    return std::nullopt;
  }
  if (error == http::error::header_limit) {
    return problem(431, fmt::format("the header has more than {} bytes", kMaxHeaderBytes), "too_large");
  }
  if (error == http::error::body_limit) return body_too_large(kMaxBodyBytes);
  return problem(400, "this is not HTTP/1.1: " + error.message(), "malformed_http");
}

}  // namespace server::http
