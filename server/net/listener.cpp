// Binds, listens, accepts.
#include "server/net/listener.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <stdexcept>

#include "server/config/endpoint.hpp"

namespace server::net {
namespace asio = boost::asio;
using asio::ip::tcp;

namespace {

constexpr std::chrono::milliseconds kPause{50}, kTurn{1};
constexpr rlim_t kDescriptors = 65'536;

// Each connection takes a file descriptor, and the usual soft limit of 1024 is for programs that need few.
void raise_descriptor_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, kDescriptors);
  setrlimit(RLIMIT_NOFILE, &limit);
}

void bind(tcp::acceptor& acceptor, const tcp::endpoint& endpoint, boost::system::error_code& error) {
  acceptor.open(endpoint.protocol());
  acceptor.set_option(tcp::acceptor::reuse_address{true});
  acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) acceptor.close();
}

[[noreturn]] void refuse(const tcp::endpoint& endpoint, const boost::system::error_code& error) {
  const std::string why = error == asio::error::address_in_use
                              ? "another program listens there; stop it, or choose another port"
                              : error.message();
  throw std::runtime_error{fmt::format("cannot listen on {}: {}", config::text(endpoint), why)};
}

}  // namespace

Listener::Listener(asio::io_context& loop, runtime::Clock& clock, const tcp::endpoint& endpoint, bool or_any_port)
    : clock_{clock}, acceptor_{loop} {
  raise_descriptor_limit();
  boost::system::error_code error;
  bind(acceptor_, endpoint, error);
  if (error == asio::error::address_in_use && or_any_port) {
    spdlog::warn("port {} is taken; using a free one", endpoint.port());
    bind(acceptor_, tcp::endpoint{endpoint.address(), 0}, error);
  }
  if (error) refuse(endpoint, error);
}

// SAFETY: a stop that waits to be accepted waits for no pause where another connection can go.
asio::awaitable<void> Listener::run(std::function<void(tcp::socket)> on_connection, std::function<bool()> give_up_one) {
  for (;;) {
    auto [error, socket] = co_await acceptor_.async_accept(asio::as_tuple(asio::use_awaitable));
    if (error == asio::error::operation_aborted) co_return;
    if (error) {  // out of descriptors, or a peer that left before it was accepted
      const bool is_without = error == asio::error::no_descriptors;
      const bool gave_up = is_without && give_up_one();
      if (const auto unsaid = lines_.next(clock_.steady_us())) {
        spdlog::warn("accept on {}: {}{}{}", config::text(endpoint()), error.message(),
                     gave_up ? "; another connection gave its place up" : "", runtime::and_before(*unsaid));
      }
      co_await clock_.sleep_for(gave_up ? kTurn : kPause);
      continue;
    }
    on_connection(std::move(socket));
  }
}

}  // namespace server::net
