// The HTTP port: accepts connections, as many as its door lets in, and lets each talk (HttpConnection).
//
// Who is refused is told 503 (all places are taken) or 429 (those of one address), in TLS nothing. A connection that
// asks for an upgrade goes on as Upgrades say.
//
// SAFETY: nobody's connections lock out a stop: strangers give way to new ones, then idle connections, and nobody at
// one address can have all places (Door). Loop thread. Outlives its connections, which are tasks of the group;
// everything it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <memory>

#include "server/http/http_stream.hpp"
#include "server/http/request_guard.hpp"
#include "server/http/router.hpp"
#include "server/http/upgrade.hpp"
#include "server/net/entrance.hpp"
#include "server/net/listener.hpp"
#include "server/runtime/tasks.hpp"

namespace server {

class HttpServer {
 public:
  HttpServer(TaskGroup& tasks, Clock& clock, Listener& listener, Entrance& entrance, const RequestGuard& guard,
             const Router& router, Upgrades& upgrades);

  boost::asio::awaitable<void> run();  // accepts until cancelled

 private:
  void on_connection(HttpStream stream);
  boost::asio::awaitable<void> serve(HttpStream stream, std::unique_ptr<Guest> guest);

  TaskGroup& tasks_;
  Clock& clock_;
  Listener& listener_;
  Entrance& entrance_;
  const RequestGuard& guard_;
  const Router& router_;
  Upgrades& upgrades_;
};

}  // namespace server
