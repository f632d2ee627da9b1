// The turns of a connection, and every way in which they end.
#include "server/http/http_connection.hpp"

#include <fmt/format.h>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/websocket/rfc6455.hpp>

#include "server/http/answer_head.hpp"

namespace server::http {
namespace asio = boost::asio;
namespace http = boost::beast::http;

namespace {

constexpr microseconds kWatchInterval{std::chrono::seconds{1}};  // how exactly time-outs are kept
constexpr std::size_t kReadBytes = 4096;
constexpr std::size_t kMaxDiscardBytes = 32 * 1024 * 1024;  // a client that sends all before it reads
constexpr const char* kHealth = "/healthz";

Response gave_way() {
  Response response = problem(503, "all connections of the station are taken; ask again in a second", "busy");
  response.headers.emplace_back("Retry-After", "1");
  return response;
}

}  // namespace

HttpConnection::HttpConnection(HttpStream stream, net::ConnectionSlot& slot, tls::TlsHandshakes* tls,
                               runtime::Clock& clock, const RequestGuard& guard, const Router& router,
                               Upgrades& upgrades, runtime::ExceptionLog& exceptions)
    : stream_{std::move(stream)},
      slot_{slot},
      tls_{tls},
      clock_{clock},
      guard_{guard},
      router_{router},
      upgrades_{upgrades},
      exceptions_{exceptions},
      deadline_{clock},
      sender_{stream_, slot, deadline_, clock, exceptions} {
  slot_.on_end([this] {
    if (is_awaited_) stream_.write_now(last_answer(gave_way(), stream_.is_secure()));
    stream_.end();
  });
}

asio::awaitable<void> HttpConnection::talk() {
  co_await contained(exceptions_, clock_, runtime::Ended::http_connection, "http connection of " + stream_.peer(),
                     take_turns());
}

asio::awaitable<void> HttpConnection::take_turns() {
  deadline_.allow(kRequestTime);
  const Next begun = co_await secure();
  if (begun == Next::end) co_return;
  for (;;) {
    const Next next = co_await read_and_answer();
    if (next == Next::end) co_return;
    deadline_.allow(kIdleTime);
  }
}

asio::awaitable<void> HttpConnection::watch() {
  while (!deadline_.has_passed()) co_await clock_.sleep_for(kWatchInterval);
  if (request_has_begun_) {
    const Response late = problem(408, "the request did not arrive in time", "too_slow");
    stream_.write_now(last_answer(late, stream_.is_secure()));
  }
  stream_.end();
}

asio::awaitable<Next> HttpConnection::secure() {
  if (tls_ == nullptr) co_return Next::another;
  const tls::TlsHandshakes::Outcome outcome = co_await tls_->secure(stream_, "http port");
  if (outcome == tls::TlsHandshakes::Outcome::secure) co_return Next::another;
  if (outcome == tls::TlsHandshakes::Outcome::not_tls) {
    const Response plain =
        problem(400, "this port speaks TLS only: use https:// instead of http://", "plain_http_on_tls_port");
    stream_.write_now(last_answer(plain, false));
    co_await discard_rest();
  }
  co_return Next::end;
}

const Upgrade* HttpConnection::wanted_upgrade(const Request& request, const RequestMessage& message) const {
  const auto found = upgrades_.at.find(request.target.path());
  if (found == upgrades_.at.end() || !boost::beast::websocket::is_upgrade(message) || buffer_.size() > 0)
    return nullptr;
  return &found->second;
}

bool HttpConnection::begin_page(const std::string& path, const identity::Caller& caller) {
  std::erase_if(upgrades_.open, [](const auto& of_one) { return of_one.second == 0; });
  std::size_t& pages = upgrades_.open[path + " of " + (caller.user.empty() ? caller.actor : caller.user)];
  if (pages >= kMaxPagesOfOne) return false;
  page_.emplace(pages);
  return true;
}

asio::awaitable<Next> HttpConnection::read_and_answer() {
  if (buffer_.size() == 0) {
    unread_since_us_.reset();
    const auto [error, size] =
        co_await stream_.async_read_some(buffer_.prepare(kReadBytes), asio::as_tuple(asio::use_awaitable));
    if (error) co_return Next::end;
    buffer_.commit(size);
    note_arrival();
  }
  deadline_.allow(kRequestTime);
  request_has_begun_ = true;
  RequestParser parser;
  parser.header_limit(kMaxHeaderBytes);
  parser.body_limit(boost::none);  // is set when it is known whose body it is
  Request head;
  boost::system::error_code error;
  take_head(parser, error);  // most come in one piece: no turn of the loop is spent on them
  while (error == http::error::need_more) {
    std::size_t size = 0;
    std::tie(error, size) =
        co_await stream_.async_read_some(buffer_.prepare(kReadBytes), asio::as_tuple(asio::use_awaitable));
    if (error) break;
    buffer_.commit(size);
    take_head(parser, error);
  }
  if (!error) {
    if (has_two_hosts(parser.get())) {
      co_return co_await send_and_close(problem(400, "the request has two Host headers", "malformed_http"),
                                        parser.release());
    }
    head = plain_head(parser.get());
    if (router_.is_stop(head.method, head.target)) co_return co_await carry_out_stop(parser, std::move(head));
    // SAFETY: a place of the reserve is free again at once: nobody lingers there.
    if (slot_.is_reserve() && head.target.path() != kHealth) {
      stream_.write_now(last_answer(gave_way(), stream_.is_secure()));
      co_return Next::end;
    }
    auto refusal = refusal_of(parser, head);
    if (refusal) co_return co_await send_and_close(std::move(*refusal), parser.release());
  }
  HeaderFields fields{parser};
  if (!error) {
    error = co_await read_body(parser);
    note_arrival();
  }
  request_has_begun_ = false;
  if (error) co_return co_await refuse_unreadable(error);
  deadline_.lift();  // a route bounds its own waits
  const Next next = co_await carry_out(std::move(head), fields.release(parser));
  if (next == Next::another) slot_.rest();
  co_return next;
}

// Gives the parser what has arrived, until the head is whole (no error) or refused. Of a part of a head it takes whole
// fields only, when it has seen that the next line does not continue them.
void HttpConnection::take_head(RequestParser& parser, boost::system::error_code& error) {
  const std::size_t size = parser.put(buffer_.data(), error);
  const std::string_view head{static_cast<const char*>(buffer_.data().data()), size};
  const bool is_read_so_far = !error || error == http::error::need_more;
  if (is_read_so_far && has_folded_line(head)) error = http::error::bad_obs_fold;
  if (!error && has_unknown_length(parser)) error = http::error::bad_transfer_encoding;
  buffer_.consume(size);
}

// SAFETY: what came while the loop stood still is as old as its last turn before, and so is what came behind it.
void HttpConnection::note_arrival() {
  const std::int64_t now_us = clock_.steady_us();
  const microseconds unread = clock_.watch().unread_for(now_us);
  if (unread.count() > 0 && !unread_since_us_) unread_since_us_ = now_us - unread.count();
}

// What the header alone is refused for. The last word has carry_out(), which knows the body.
std::optional<Response> HttpConnection::refusal_of(RequestParser& parser, const Request& head) {
  if (auto too_large = header_too_large(parser.get())) return too_large;
  if (parser.is_done()) return std::nullopt;  // there is no body
  parser.body_limit(kMaxBodyBytes);
  const std::uint64_t length = parser.content_length().value_or(0);
  const std::size_t limit = router_.max_body_bytes(head.method, head.target);
  if (length > limit) return body_too_large(limit);
  auto admitted = guard_.admit(head, length > 0);
  if (!admitted) return std::move(admitted.error());
  if (!admitted->actor.empty()) {
    if (length <= kMaxBodyBytes) return std::nullopt;
    admitted->peer = address_of(stream_);
    const std::optional<identity::Scope> lacking = router_.scope_lacking(head.method, head.target, *admitted);
    if (lacking) return not_permitted(*admitted, *lacking);
    parser.body_limit(limit);
    parser.get().body().reserve(length);
    deadline_.allow(kLongBodyTime);
    return std::nullopt;
  }
  parser.body_limit(kMaxLoginBodyBytes);
  if (parser.content_length().value_or(0) <= kMaxLoginBodyBytes) return std::nullopt;
  return body_too_large(kMaxLoginBodyBytes);
}

asio::awaitable<boost::system::error_code> HttpConnection::read_body(RequestParser& parser) {
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

asio::awaitable<Next> HttpConnection::carry_out(Request request, RequestMessage message) {
  request.body = std::move(message.body());
  request.received_us = clock_.steady_us();
  if (unread_since_us_) request.unread = microseconds{request.received_us - *unread_since_us_};
  auto admitted = guard_.admit(request);
  if (!admitted) co_return co_await sender_.send(std::move(admitted.error()), message);
  admit(request, std::move(*admitted));
  if (const Upgrade* wanted = wanted_upgrade(request, message)) {
    if (wanted->admit) {
      auto let_in = wanted->admit(request);
      if (!let_in) co_return co_await sender_.send(std::move(let_in.error()), message);
      admit(request, std::move(*let_in));
    }
    if (!begin_page(request.target.path(), request.caller)) {
      Response refused = problem(429, fmt::format("{} has {} pages open; close some", request.actor, kMaxPagesOfOne),
                                 "too_many_pages");
      co_return co_await sender_.send(std::move(refused), message);
    }
    upgrade_.emplace(message.base());
    takes_over_ = wanted;
    caller_ = std::move(request.caller);
    co_return Next::end;
  }
  // SAFETY: what changes something, above all a stop, is carried out though its client has hung up.
  if (request.method != "GET" && request.method != "HEAD") {
    Response response = co_await answer(std::move(request));
    slot_.rest();  // SAFETY: who takes no answer holds no place of others by that
    co_return co_await sender_.send(std::move(response), message);
  }
  // A question may give its place up: at once while its answer is made, and where the client takes it slowly.
  if (request.caller.standing != nullptr) slot_.becomes(net::ConnectionSlot::waiting);
  const std::shared_ptr<identity::Standing> standing = request.caller.standing;
  const std::string actor = request.actor;
  is_awaited_ = true;
  auto response = co_await while_present(stream_, while_it_stands(standing, answer(std::move(request))));
  is_awaited_ = false;
  if (!response) co_return Next::end;
  if (standing != nullptr) slot_.becomes(net::ConnectionSlot::sending);
  if (!*response) {
    co_return co_await sender_.send(problem(identity::credential_ended(actor)), message);
  }
  const bool is_long = (*response)->stream != nullptr;
  auto sending = sender_.send(std::move(**response), message);
  if (!is_long) co_return co_await std::move(sending);
  co_return (co_await while_it_stands(standing, std::move(sending))).value_or(Next::end);
}

// SAFETY: a stop is carried out now, whatever comes with it; its body is looked at when it has been answered.
asio::awaitable<Next> HttpConnection::carry_out_stop(RequestParser& parser, Request request) {
  request_has_begun_ = false;
  deadline_.lift();
  const RequestMessage& message = parser.get();
  request.received_us = clock_.steady_us();
  auto admitted = guard_.admit(request);
  if (!admitted && parser.is_done()) co_return co_await sender_.send(std::move(admitted.error()), message);
  if (!admitted) co_return co_await send_and_close(std::move(admitted.error()), parser.release());
  admit(request, std::move(*admitted));
  Response response = co_await answer(std::move(request));
  slot_.rest();
  const bool goes_on = parser.is_done() || can_pass_over_body(parser);
  if (!goes_on) co_return co_await send_and_close(std::move(response), parser.release());
  const Next next = co_await sender_.send(std::move(response), message);
  if (next == Next::end) co_return next;
  slot_.rest();
  deadline_.allow(kRequestTime);
  parser.body_limit(kMaxBodyBytes);
  const boost::system::error_code error = co_await read_body(parser);
  if (!error) co_return Next::another;
  co_await discard_rest();
  co_return Next::end;
}

void HttpConnection::admit(Request& request, identity::Caller caller) {
  if (!caller.actor.empty()) slot_.becomes(net::ConnectionSlot::busy);
  request.caller = std::move(caller);
  request.caller.peer = address_of(stream_);
  // SAFETY: what is no id is none; a stop is carried out whatever its client calls itself.
  if (std::string id = request.header("rheonaut-client"); identity::is_client_id(id)) {
    request.caller.client = std::move(id);
  }
  request.actor = request.caller.actor;
  request.peer = request.caller.peer;
}

// Says why, if the client spoke at all, and gives it the time to read that.
asio::awaitable<Next> HttpConnection::refuse_unreadable(boost::system::error_code error) {
  auto response = unreadable(error);
  if (!response) co_return Next::end;
  RequestMessage message;
  message.version(11);
  co_return co_await send_and_close(std::move(*response), std::move(message));
}

asio::awaitable<Next> HttpConnection::send_and_close(Response response, RequestMessage message) {
  request_has_begun_ = false;
  message.keep_alive(false);
  slot_.rest();
  co_await sender_.send(std::move(response), message);
  co_await discard_rest();
  co_return Next::end;
}

// Closing with unread bytes would reset the connection and could destroy the answer on its way.
asio::awaitable<void> HttpConnection::discard_rest() {
  stream_.wire().end_sending();
  deadline_.allow(kLingerTime);
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
    failure = runtime::first_of(std::current_exception());
  }
  if (runtime::is_cancellation(failure)) std::rethrow_exception(failure);
  exceptions_.note(runtime::Ended::request, route, failure, clock_.steady_us());
  co_return problem(500, "the station could not answer; its log says why", "internal");
}

}  // namespace server::http
