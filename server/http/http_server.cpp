// Accepts connections and turns them into tasks.
#include "server/http/http_server.hpp"

#include <boost/asio/experimental/awaitable_operators.hpp>

#include "server/http/answer_head.hpp"
#include "server/http/http_connection.hpp"
#include "server/runtime/worker.hpp"

namespace server::http {
namespace asio = boost::asio;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

// In the middle of a handshake nobody would understand it.
void say_why(tls::StreamSocket& stream, net::ConnectionLimiter::Refusal refusal) {
  Response response = problem(503, "all connections of the station are taken; try again", "busy");
  if (refusal == net::ConnectionLimiter::Refusal::address_has_its_share) {
    response = problem(429, "your address has as many connections as the station allows; close some", "busy");
  }
  response.headers.emplace_back("Retry-After", "5");
  stream.write_now(last_answer(response, false));
}

}  // namespace

HttpServer::HttpServer(runtime::TaskGroup& tasks, runtime::Clock& clock, net::Listener& listener,
                       net::PortAccess& access, const RequestGuard& guard, const Router& router, Upgrades& upgrades)
    : tasks_{tasks},
      clock_{clock},
      listener_{listener},
      access_{access},
      guard_{guard},
      router_{router},
      upgrades_{upgrades} {}

asio::awaitable<void> HttpServer::run() {
  const runtime::Counted listening{access_.listening};
  auto accepted = [this](tcp::socket socket) { on_connection(HttpStream{std::move(socket)}); };
  auto give_up_one = [this] { return access_.limiter.give_up_one(); };
  co_await listener_.run(accepted, give_up_one);
}

void HttpServer::on_connection(HttpStream stream) {
  auto slot = access_.limiter.admit(address_of(stream), stream.from_loopback());
  if (slot) {
    const std::string which = "http connection of " + stream.peer();
    tasks_.spawn("http connection", contained(tasks_.exceptions(), clock_, runtime::Ended::http_connection, which,
                                              serve(std::move(stream), std::move(*slot))));
  } else if (access_.tls == nullptr) {
    say_why(stream, slot.error());
  }
}

asio::awaitable<void> HttpServer::serve(HttpStream stream, std::unique_ptr<net::ConnectionSlot> slot) {
  HttpConnection connection{std::move(stream), *slot,     access_.tls,        clock_, guard_,
                            router_,           upgrades_, tasks_.exceptions()};
  co_await (connection.talk() || connection.watch());
  if (!connection.wants_upgrade()) co_return;
  co_await contained(
      tasks_.exceptions(), clock_, runtime::Ended::live_page, "page of " + connection.caller().actor,
      connection.takes_over().serve(connection.take_stream(), connection.take_upgrade(), connection.caller()));
}

}  // namespace server::http
