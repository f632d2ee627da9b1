// Reads HTTP/1.1 with Beast, and writes it with answer_head; the only unit besides the WebSocket of /live that knows
// it. LONG: the turns of a connection, and every way in which they end, stand in one place.
#include "server/http/http_connection.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/multiple_exceptions.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <cctype>
#include <limits>
#include <variant>

#include "server/http/answer_head.hpp"

namespace server {
namespace asio = boost::asio;
namespace http = boost::beast::http;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

constexpr auto kNever = std::numeric_limits<std::int64_t>::max();
constexpr microseconds kWatchInterval{std::chrono::seconds{1}};  // how exactly time-outs are kept
constexpr std::size_t kReadBytes = 4096;
constexpr std::size_t kMaxDiscardBytes = 1024 * 1024;

// All but the body.
template <class Message>
Request plain_head(const Message& message) {
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
  return request;
}

std::string route_of(std::string_view method, std::string_view target) {
  return fmt::format("{} {}", method, target.substr(0, 200));
}

Response body_too_large(std::size_t limit) {
  return problem(413, fmt::format("the body has more than {} bytes", limit), "too_large");
}

// The length of what follows the header is not known: Beast takes a coding that it does not know for no body at all.
bool has_unknown_length(const http::request_parser<http::string_body>& parser) {
  return parser.get().count(http::field::transfer_encoding) > 0 && !parser.chunked();
}

// Whether the connection can go on behind a body that nobody needs. Told what became of its request, a client that
// expects 100-continue may leave the body out; what follows may then be either.
bool can_pass_over_body(const http::request_parser<http::string_body>& parser) {
  const auto& head = parser.get();
  if (!head.keep_alive() || head.version() < 11 || head.count(http::field::expect) > 0) return false;
  return parser.content_length().value_or(0) <= kMaxBodyBytes;
}

}  // namespace

HttpConnection::HttpConnection(HttpStream stream, ConnectionSlot& slot, TlsHandshakes* tls, Clock& clock,
                               const RequestGuard& guard, const Router& router, Upgrades& upgrades,
                               ExceptionLog& exceptions)
    : stream_{std::move(stream)},
      slot_{slot},
      tls_{tls},
      clock_{clock},
      guard_{guard},
      router_{router},
      upgrades_{upgrades},
      exceptions_{exceptions},
      deadline_us_{kNever} {
  slot_.on_end([this] { stream_.end(); });
}

asio::awaitable<void> HttpConnection::talk() {
  co_await contained(exceptions_, clock_, Ended::http_connection, "http connection of " + stream_.peer(), take_turns());
}

asio::awaitable<void> HttpConnection::take_turns() {
  allow(kRequestTime);
  const Next begun = co_await secure();
  if (begun == Next::end) co_return;
  for (;;) {
    const Next next = co_await read_and_answer();
    if (next == Next::end) co_return;
    allow(kIdleTime);
  }
}

asio::awaitable<void> HttpConnection::watch() {
  while (clock_.steady_us() < deadline_us_) co_await clock_.sleep_for(kWatchInterval);
  if (request_has_begun_) {
    const Response late = problem(408, "the request did not arrive in time", "too_slow");
    stream_.write_now(last_answer(late, stream_.is_secure()));
  }
  stream_.end();
}

asio::awaitable<HttpConnection::Next> HttpConnection::secure() {
  if (tls_ == nullptr) co_return Next::another;
  const TlsHandshakes::Outcome outcome = co_await tls_->secure(stream_, "http port");
  if (outcome == TlsHandshakes::Outcome::secure) co_return Next::another;
  if (outcome == TlsHandshakes::Outcome::not_tls) {
    const Response plain =
        problem(400, "this port speaks TLS only: use https:// instead of http://", "plain_http_on_tls_port");
    stream_.write_now(last_answer(plain, false));
    co_await discard_rest();
  }
  co_return Next::end;
}

bool HttpConnection::wants_upgrade(const Request& request, const Message& message) const {
  return request.target.path() == upgrades_.path && boost::beast::websocket::is_upgrade(message) && buffer_.size() == 0;
}

bool HttpConnection::begin_page(const Caller& caller) {
  std::erase_if(upgrades_.open, [](const auto& of_one) { return of_one.second == 0; });
  std::size_t& pages = upgrades_.open[caller.user.empty() ? caller.actor : caller.user];
  if (pages >= kMaxPagesOfOne) return false;
  page_.emplace(pages);
  return true;
}

asio::awaitable<HttpConnection::Next> HttpConnection::read_and_answer() {
  if (buffer_.size() == 0) {
    unread_since_us_.reset();
    const auto [error, size] =
        co_await stream_.async_read_some(buffer_.prepare(kReadBytes), asio::as_tuple(asio::use_awaitable));
    if (error) co_return Next::end;
    buffer_.commit(size);
    note_arrival();
  }
  allow(kRequestTime);
  request_has_begun_ = true;
  Parser parser;
  parser.header_limit(kMaxHeaderBytes);
  parser.body_limit(boost::none);  // is set when it is known whose body it is
  Request head;
  boost::system::error_code error;
  buffer_.consume(parser.put(buffer_.data(), error));  // most come in one piece: no turn of the loop is spent on them
  if (error == http::error::need_more) {
    std::tie(error, std::ignore) =
        co_await http::async_read_header(stream_, buffer_, parser, asio::as_tuple(asio::use_awaitable));
  }
  if (!error && has_unknown_length(parser)) error = http::error::bad_transfer_encoding;
  if (!error) {
    head = plain_head(parser.get());
    if (router_.is_stop(head.method, head.target)) co_return co_await carry_out_stop(parser, std::move(head));
    auto refusal = refusal_of(parser, head);
    if (refusal) co_return co_await send_and_close(std::move(*refusal), parser.release());
    error = co_await read_body(parser);
    note_arrival();
  }
  request_has_begun_ = false;
  if (error) co_return co_await refuse_unreadable(error);
  deadline_us_ = kNever;  // a route bounds its own waits
  const Next next = co_await carry_out(std::move(head), parser.release());
  if (next == Next::another) slot_.rest();
  co_return next;
}

// SAFETY: what came while the loop stood still is as old as its last turn before, and so is what came behind it.
void HttpConnection::note_arrival() {
  const std::int64_t now_us = clock_.steady_us();
  const microseconds unread = clock_.watch().unread_for(now_us);
  if (unread.count() > 0 && !unread_since_us_) unread_since_us_ = now_us - unread.count();
}

// What the header alone is refused for. The last word has carry_out(), which knows the body.
std::optional<Response> HttpConnection::refusal_of(Parser& parser, const Request& head) {
  const Message& message = parser.get();
  if (head.target.text().size() > kMaxTargetBytes) {
    return problem(414, fmt::format("the target has more than {} bytes", kMaxTargetBytes), "too_large");
  }
  if (std::distance(message.begin(), message.end()) > static_cast<std::ptrdiff_t>(kMaxHeaderFields)) {
    return problem(431, fmt::format("the header has more than {} fields", kMaxHeaderFields), "too_large");
  }
  if (parser.is_done()) return std::nullopt;  // there is no body
  parser.body_limit(kMaxBodyBytes);
  const std::uint64_t length = parser.content_length().value_or(0);
  const std::size_t limit = router_.max_body_bytes(head.method, head.target);
  if (length > limit) return body_too_large(limit);
  auto admitted = guard_.admit(head);
  if (!admitted) return std::move(admitted.error());
  if (!admitted->actor.empty()) {
    if (length <= kMaxBodyBytes) return std::nullopt;
    admitted->peer = address_of(stream_);
    const std::optional<Scope> lacking = router_.scope_lacking(head.method, head.target, *admitted);
    if (lacking) return not_permitted(*admitted, *lacking);
    parser.body_limit(limit);
    parser.get().body().reserve(length);
    allow(kLongBodyTime);
    return std::nullopt;
  }
  parser.body_limit(kMaxLoginBodyBytes);
  if (parser.content_length().value_or(0) <= kMaxLoginBodyBytes) return std::nullopt;
  return body_too_large(kMaxLoginBodyBytes);
}

asio::awaitable<boost::system::error_code> HttpConnection::read_body(Parser& parser) {
  if (parser.is_done()) co_return boost::system::error_code{};
  if (parser.get()[http::field::expect] == "100-continue") {
    const std::string go_on = "HTTP/1.1 100 Continue\r\n\r\n";
    co_await asio::async_write(stream_, asio::buffer(go_on), asio::as_tuple(asio::use_awaitable));
  }
  boost::system::error_code error;
  parser.eager(true);
  buffer_.consume(parser.put(buffer_.data(), error));
  if (error == http::error::need_more || (!error && !parser.is_done())) {
    std::tie(error, std::ignore) =
        co_await http::async_read(stream_, buffer_, parser, asio::as_tuple(asio::use_awaitable));
  }
  co_return error;
}

asio::awaitable<HttpConnection::Next> HttpConnection::carry_out(Request request, Message message) {
  request.body = std::move(message.body());
  request.received_us = clock_.steady_us();
  if (unread_since_us_) request.unread = microseconds{request.received_us - *unread_since_us_};
  auto admitted = guard_.admit(request);
  if (!admitted) co_return co_await send(std::move(admitted.error()), message);
  admit(request, std::move(*admitted));
  if (wants_upgrade(request, message)) {
    if (!begin_page(request.caller)) {
      Response refused = problem(429, fmt::format("{} has {} pages open; close some", request.actor, kMaxPagesOfOne),
                                 "too_many_pages");
      co_return co_await send(std::move(refused), message);
    }
    upgrade_.emplace(message.base());
    caller_ = std::move(request.caller);
    co_return Next::end;
  }
  // SAFETY: what changes something, above all a stop, is carried out though its client has hung up.
  if (request.method != "GET" && request.method != "HEAD") {
    Response response = co_await answer(std::move(request));
    co_return co_await send(std::move(response), message);
  }
  auto response = co_await while_present(answer(std::move(request)));
  if (!response) co_return Next::end;
  co_return co_await send(std::move(*response), message);
}

// SAFETY: a stop is carried out now, whatever comes with it; its body is looked at when it has been answered.
asio::awaitable<HttpConnection::Next> HttpConnection::carry_out_stop(Parser& parser, Request request) {
  request_has_begun_ = false;
  deadline_us_ = kNever;
  const Message& message = parser.get();
  request.received_us = clock_.steady_us();
  auto admitted = guard_.admit(request);
  if (!admitted && parser.is_done()) co_return co_await send(std::move(admitted.error()), message);
  if (!admitted) co_return co_await send_and_close(std::move(admitted.error()), parser.release());
  admit(request, std::move(*admitted));
  Response response = co_await answer(std::move(request));
  const bool goes_on = parser.is_done() || can_pass_over_body(parser);
  if (!goes_on) co_return co_await send_and_close(std::move(response), parser.release());
  const Next next = co_await send(std::move(response), message);
  if (next == Next::end) co_return next;
  slot_.rest();
  allow(kRequestTime);
  parser.body_limit(kMaxBodyBytes);
  const boost::system::error_code error = co_await read_body(parser);
  if (!error) co_return Next::another;
  co_await discard_rest();
  co_return Next::end;
}

void HttpConnection::admit(Request& request, Caller caller) {
  if (!caller.actor.empty()) slot_.becomes(ConnectionSlot::busy);
  request.caller = std::move(caller);
  request.caller.peer = address_of(stream_);
  request.actor = request.caller.actor;
  request.peer = request.caller.peer;
}

// What the work gives, or nothing when the client goes first: the work is cancelled then, and has ended.
template <class T>
asio::awaitable<std::optional<T>> HttpConnection::while_present(asio::awaitable<T> work) {
  try {
    std::variant<T, std::monostate> first = co_await (std::move(work) || stream_.peer_gone());
    if (first.index() == 0) co_return std::move(std::get<0>(first));
    co_return std::nullopt;
  } catch (const asio::multiple_exceptions&) {  // both were cancelled: the station stops, or the time is over
    throw boost::system::system_error{asio::error::operation_aborted};
  }
}

// Says why, if the client spoke at all, and gives it the time to read that.
asio::awaitable<HttpConnection::Next> HttpConnection::refuse_unreadable(boost::system::error_code error) {
  static const auto& http_category = http::make_error_code(http::error::bad_method).category();
  if (error.category() != http_category || error == http::error::end_of_stream ||
      error == http::error::partial_message) {
    co_return Next::end;
  }
  Response response = problem(400, "this is not HTTP/1.1: " + error.message(), "malformed_http");
  if (error == http::error::header_limit) {
    response = problem(431, fmt::format("the header has more than {} bytes", kMaxHeaderBytes), "too_large");
  } else if (error == http::error::body_limit) {
    response = body_too_large(kMaxBodyBytes);
  }
  Message unreadable;
  unreadable.version(11);
  co_return co_await send_and_close(std::move(response), std::move(unreadable));
}

asio::awaitable<HttpConnection::Next> HttpConnection::send_and_close(Response response, Message message) {
  request_has_begun_ = false;
  message.keep_alive(false);
  co_await send(std::move(response), message);
  co_await discard_rest();
  co_return Next::end;
}

// Closing with unread bytes would reset the connection and could destroy the answer on its way.
asio::awaitable<void> HttpConnection::discard_rest() {
  stream_.wire().end_sending();
  allow(kLingerTime);
  buffer_.clear();
  std::size_t discarded = 0;
  while (discarded < kMaxDiscardBytes) {
    const auto [error, size] =
        co_await stream_.async_read_some(buffer_.prepare(kReadBytes), asio::as_tuple(asio::use_awaitable));
    if (error) co_return;
    discarded += size;
  }
}

// The boundary: whatever a route throws ends here, and says nothing of the inside to the outside.
asio::awaitable<Response> HttpConnection::answer(Request request) {
  const std::string route = route_of(request.method, request.target.text());
  std::exception_ptr failure;
  try {
    co_return co_await router_.dispatch(std::move(request));
  } catch (...) {
    failure = first_of(std::current_exception());
  }
  if (is_cancellation(failure)) std::rethrow_exception(failure);
  exceptions_.note(Ended::request, route, failure, clock_.steady_us());
  co_return problem(500, "the station could not answer; its log says why", "internal");
}

asio::awaitable<HttpConnection::Next> HttpConnection::send(Response response, const Message& to) {
  const bool has_body = to.method() != http::verb::head && may_have_body(response.status);
  const bool is_framed = response.stream == nullptr || to.version() >= 11;  // else the connection's end is its end
  const Framing framing{to.version(), to.keep_alive() && is_framed, stream_.is_secure(), to[http::field::host]};
  const std::string head = answer_head(response, framing);
  const std::array parts{asio::buffer(head), has_body ? asio::buffer(response.body) : asio::const_buffer{}};
  allow(kWriteTime);
  const auto [error, size] = co_await asio::async_write(stream_, parts, asio::as_tuple(asio::use_awaitable));
  if (error) co_return Next::end;
  if (response.stream != nullptr && has_body) {
    const bool is_whole = co_await send_stream(*response.stream, is_framed, route_of(to.method_string(), to.target()));
    if (!is_whole) co_return Next::end;
  }
  co_return framing.keep_alive ? Next::another : Next::end;
}

// False when it was cut short: the missing last chunk shows it to the client (HTTP/1.0 has no way to say so).
asio::awaitable<bool> HttpConnection::send_stream(BodyStream& body, bool chunked, std::string route) {
  for (;;) {
    deadline_us_ = kNever;
    const auto made = co_await while_present(next_piece(body, route));
    if (!made || !*made) co_return false;
    const std::optional<std::string>& piece = **made;
    if (!piece) break;
    if (piece->empty()) continue;
    allow(kWriteTime);
    boost::system::error_code error;
    const auto bytes = asio::buffer(*piece);
    if (chunked) {
      std::tie(error, std::ignore) =
          co_await asio::async_write(stream_, http::make_chunk(bytes), asio::as_tuple(asio::use_awaitable));
    } else {
      std::tie(error, std::ignore) = co_await asio::async_write(stream_, bytes, asio::as_tuple(asio::use_awaitable));
    }
    if (error) co_return false;
  }
  if (!chunked) co_return true;
  allow(kWriteTime);
  const auto [error, size] =
      co_await asio::async_write(stream_, http::make_chunk_last(), asio::as_tuple(asio::use_awaitable));
  co_return !error;
}

asio::awaitable<Result<std::optional<std::string>>> HttpConnection::next_piece(BodyStream& body,
                                                                               const std::string& route) {
  std::exception_ptr failure;
  try {
    auto piece = co_await body.next();
    if (!piece) spdlog::error("{}: the answer was cut short: {}", route, piece.error().detail);
    co_return piece;
  } catch (...) {
    failure = first_of(std::current_exception());
  }
  if (is_cancellation(failure)) std::rethrow_exception(failure);
  exceptions_.note(Ended::request, route + ": the answer was cut short", failure, clock_.steady_us());
  co_return fail(ErrorCode::internal, text_of(failure));
}

}  // namespace server
