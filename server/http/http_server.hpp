// The HTTP port: accepts connections, as many as its limiter admits, and serves each (HttpConnection).
//
// A refused connection gets 503 (all slots are taken) or 429 (those of its address); where TLS is spoken it is closed.
// A connection that asks for an upgrade goes on as Upgrades say.
//
// SAFETY: nobody's connections lock out a stop: unauthenticated ones are evicted for new ones, then idle ones, and no
// address can have all slots (ConnectionLimiter). Loop thread. Outlives its connections, which are tasks of the group;
// everything it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <memory>

#include "server/http/http_stream.hpp"
#include "server/http/request_guard.hpp"
#include "server/http/router.hpp"
#include "server/http/upgrade.hpp"
#include "server/net/listener.hpp"
#include "server/net/port_access.hpp"
#include "server/runtime/tasks.hpp"

namespace server::http {

class HttpServer {
 public:
  HttpServer(runtime::TaskGroup& tasks, runtime::Clock& clock, net::Listener& listener, net::PortAccess& access,
             const RequestGuard& guard, const Router& router, Upgrades& upgrades);

  boost::asio::awaitable<void> run();  // accepts until cancelled

 private:
  void on_connection(HttpStream stream);
  boost::asio::awaitable<void> serve(HttpStream stream, std::unique_ptr<net::ConnectionSlot> slot);

  runtime::TaskGroup& tasks_;
  runtime::Clock& clock_;
  net::Listener& listener_;
  net::PortAccess& access_;
  const RequestGuard& guard_;
  const Router& router_;
  Upgrades& upgrades_;
};

}  // namespace server::http
