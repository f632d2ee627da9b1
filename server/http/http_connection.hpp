// One connection of the HTTP port: its handshake, then requests and answers in turn, until it ends or asks for an
// upgrade.
//
// Limits of a request: target 8 kB (414), header 16 kB and 100 fields (431), body 64 kB or what its route allows to who
// may use it, of signing in 4 kB (413). The header is judged before the body is read, so nobody sends one who may not
// (401, 403, …). 10 s for a request to arrive as a whole, however it drips, and a minute where its body is over 64 kB
// (408), 60 s idle between two, 30 s for the client to take a piece of the answer.
// Malformed HTTP is 400 and the end of the connection. An exception of a route is logged and answered with 500. A GET
// whose client has gone is cancelled; a POST is always carried out. In TLS the handshake is part of the first request's
// 10 s, and plain HTTP is answered with 400. Each answer has the security headers, and is not cached unless it
// says so itself. Loop thread. What it is given outlives it.
//
// SAFETY: an emergency stop is carried out when its head is complete. Of the head only Host, Origin and credential are
// judged, and whether the length of the body is beyond doubt; the limits of target and fields do not hold. The body is
// passed over after the answer; one that may be larger than 64 kB, or that the client may not send after all, ends the
// connection, so that nothing of it is ever taken for a request.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <cstdint>
#include <memory>
#include <optional>

#include "server/http/answer_sender.hpp"
#include "server/http/deadline.hpp"
#include "server/http/http_stream.hpp"
#include "server/http/request_guard.hpp"
#include "server/http/request_reading.hpp"
#include "server/http/router.hpp"
#include "server/http/upgrade.hpp"
#include "server/net/port_access.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/worker.hpp"

namespace server::http {

inline constexpr std::size_t kMaxPagesOfOne = 32;  // WebSockets at one path, of one user, token or link
inline constexpr microseconds kRequestTime{std::chrono::seconds{10}};
inline constexpr microseconds kLongBodyTime{std::chrono::seconds{60}};
inline constexpr microseconds kIdleTime{std::chrono::seconds{60}};
inline constexpr microseconds kLingerTime{std::chrono::seconds{2}};  // for a refused client to read why

class HttpConnection {
 public:
  HttpConnection(HttpStream stream, net::ConnectionSlot& slot, tls::TlsHandshakes* tls, runtime::Clock& clock,
                 const RequestGuard& guard, const Router& router, Upgrades& upgrades,
                 runtime::ExceptionLog& exceptions);
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  boost::asio::awaitable<void> talk();
  boost::asio::awaitable<void> watch();  // ends when the deadline of whatever talk() waits for has passed

  bool wants_upgrade() const { return upgrade_.has_value(); }
  HttpStream take_stream() { return std::move(stream_); }
  UpgradeRequest take_upgrade() { return std::move(*upgrade_); }
  const Upgrade& takes_over() const { return *takes_over_; }
  const identity::Caller& caller() const { return caller_; }

 private:
  boost::asio::awaitable<void> take_turns();
  boost::asio::awaitable<Next> secure();
  boost::asio::awaitable<Next> read_and_answer();
  boost::asio::awaitable<boost::system::error_code> read_body(RequestParser& parser);
  boost::asio::awaitable<Next> carry_out(Request request, RequestMessage message);
  boost::asio::awaitable<Next> carry_out_stop(RequestParser& parser, Request request);
  void admit(Request& request, identity::Caller caller);
  std::optional<Response> refusal_of(RequestParser& parser, const Request& head);
  boost::asio::awaitable<Next> refuse_unreadable(boost::system::error_code error);
  boost::asio::awaitable<Next> send_and_close(Response response, RequestMessage message);
  boost::asio::awaitable<Response> answer(Request request);
  boost::asio::awaitable<void> discard_rest();

  void note_arrival();
  void take_head(RequestParser& parser, boost::system::error_code& error);
  const Upgrade* wanted_upgrade(const Request& request, const RequestMessage& message) const;  // null: none
  bool begin_page(const std::string& path, const identity::Caller& caller);  // false: there are too many of one

  HttpStream stream_;
  net::ConnectionSlot& slot_;
  tls::TlsHandshakes* tls_;  // null: plain HTTP
  runtime::Clock& clock_;
  const RequestGuard& guard_;
  const Router& router_;
  Upgrades& upgrades_;
  runtime::ExceptionLog& exceptions_;
  boost::beast::flat_buffer buffer_{kMaxHeaderBytes + kMaxBodyBytes};
  Deadline deadline_;
  AnswerSender sender_;
  bool request_has_begun_ = false;
  bool is_awaited_ = false;                      // the answer to a question is being made, and nothing of it was sent
  std::optional<std::int64_t> unread_since_us_;  // what was read last may have waited so long; empty: it has not
  std::optional<UpgradeRequest> upgrade_;
  const Upgrade* takes_over_ = nullptr;                // not null where there is an upgrade
  std::optional<runtime::Counted<std::size_t>> page_;  // among the pages of its caller
  identity::Caller caller_;                            // of the page
};

}  // namespace server::http
