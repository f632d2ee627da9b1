// The HTTP port: accepts connections, reads requests within limits, and answers through guard and router.
//
// Limits: 256 connections (below), header 16 kB (431), body 64 kB (413), 10 s for a request to arrive (408), 60 s idle,
// 30 s for a client to take a piece of the answer. Malformed HTTP is 400 and the end of the connection. An exception of
// a route is logged and answered with 500. An upgrade at /live becomes a LivePage. A GET whose client has gone is
// cancelled; a POST is always carried out. In TLS the handshake is part of the first request's 10 s, and who speaks
// plain HTTP is told so (400).
//
// SAFETY: silent connections must not lock out a stop. When all 256 are taken, a new one replaces the oldest stranger,
// that is a connection which has sent no request with a valid credential; it is refused (503) when there is none.
// Loop thread. Outlives its connections, which are tasks of the group; everything it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <cstdint>
#include <list>

#include "server/api/http_stream.hpp"
#include "server/api/live_messages.hpp"
#include "server/api/request_guard.hpp"
#include "server/api/router.hpp"
#include "server/net/listener.hpp"
#include "server/net/tls_gate.hpp"

namespace server {

inline constexpr std::size_t kMaxConnections = 256;
inline constexpr std::size_t kMaxHeaderBytes = 16 * 1024;
inline constexpr std::size_t kMaxBodyBytes = 64 * 1024;
inline constexpr microseconds kRequestTime{std::chrono::seconds{10}};
inline constexpr microseconds kIdleTime{std::chrono::seconds{60}};
inline constexpr microseconds kWriteTime{std::chrono::seconds{30}};
inline constexpr microseconds kLingerTime{std::chrono::seconds{2}};  // for a refused client to read why

class HttpServer {
 public:
  HttpServer(TaskGroup& tasks, Clock& clock, Listener& listener, const RequestGuard& guard, const Router& router,
             LiveParts& live, TlsGate* tls);  // null: plain HTTP

  boost::asio::awaitable<void> run();  // accepts until cancelled

  std::size_t connections() const { return connections_; }

 private:
  void on_connection(boost::asio::ip::tcp::socket socket);
  bool make_room();  // false when everyone is known
  boost::asio::awaitable<void> serve(boost::asio::ip::tcp::socket socket);

  TaskGroup& tasks_;
  Clock& clock_;
  Listener& listener_;
  const RequestGuard& guard_;
  const Router& router_;
  LiveParts& live_;
  TlsGate* tls_;
  std::size_t connections_ = 0;
  std::list<HttpStream*> strangers_;  // oldest first; each owned by its connection
};

}  // namespace server
