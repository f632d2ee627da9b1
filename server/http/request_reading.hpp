// What a connection reads from Beast's parser of requests: the head as a plain value, whether the end of the body is
// known, and the answers to what is not HTTP or too large.
#pragma once

#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <cstddef>
#include <optional>
#include <string_view>

#include "server/http/http.hpp"

namespace server::http {

inline constexpr std::size_t kMaxHeaderBytes = 16 * 1024;
inline constexpr std::size_t kMaxTargetBytes = 8 * 1024;
inline constexpr std::size_t kMaxHeaderFields = 100;
inline constexpr std::size_t kMaxLoginBodyBytes = 4 * 1024;  // of unauthenticated

using RequestMessage = boost::beast::http::request<boost::beast::http::string_body>;
using RequestParser = boost::beast::http::request_parser<boost::beast::http::string_body>;

// All but the body. Repeated fields are joined; the host is that of the target where it names one.
Request plain_head(const RequestMessage& message);

// Whether a line of the head begins with a blank (obs-fold of RFC 9112, section 5.2). Beast joins it to the line
// before; another program on the way may take it for a field of its own, and read another length of the body.
bool has_folded_line(std::string_view head);

// Whether a request has two Host fields: then it is in doubt which names the station (RFC 9112, section 3.2).
bool has_two_hosts(const RequestMessage& message);

// The length of what follows the header is not known: Beast takes a coding that it does not know for no body at all.
bool has_unknown_length(const RequestParser& parser);

// Whether the connection can go on behind a body that nobody needs. Once it has its answer, a client that
// expects 100-continue may leave the body out; what follows may then be the body or the next request.
bool can_pass_over_body(const RequestParser& parser);

// The message with the fields of its header alone: Beast adds the trailers of a chunked body to them.
class HeaderFields {
 public:
  explicit HeaderFields(const RequestParser& parser);  // when the header is complete, and before the body is read
  RequestMessage release(RequestParser& parser);

 private:
  std::optional<RequestMessage::header_type> of_chunked_;
};

Response body_too_large(std::size_t limit);
// The refusal, 414 or 431, of a header that is within Beast's own limit; none where it is short enough.
std::optional<Response> header_too_large(const RequestMessage& message);
// The answer to a request that the parser refused; none when the client has gone.
std::optional<Response> unreadable(boost::system::error_code error);

}  // namespace server::http
