// Binds, listens, accepts.
#include "server/net/listener.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <charconv>
#include <sstream>
#include <stdexcept>

namespace server {
namespace asio = boost::asio;
using asio::ip::tcp;

namespace {

void bind(tcp::acceptor& acceptor, const tcp::endpoint& endpoint, boost::system::error_code& error) {
  acceptor.open(endpoint.protocol());
  acceptor.set_option(tcp::acceptor::reuse_address{true});
  acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) acceptor.close();
}

}  // namespace

Listener::Listener(asio::io_context& loop, Clock& clock, const tcp::endpoint& endpoint, bool or_any_port)
    : clock_{clock}, acceptor_{loop} {
  boost::system::error_code error;
  bind(acceptor_, endpoint, error);
  if (error == asio::error::address_in_use && or_any_port) {
    spdlog::warn("port {} is taken; using a free one", endpoint.port());
    bind(acceptor_, tcp::endpoint{endpoint.address(), 0}, error);
  }
  if (error) throw boost::system::system_error{error, "cannot listen on " + text(endpoint)};
}

asio::awaitable<void> Listener::run(std::function<void(tcp::socket)> on_connection) {
  for (;;) {
    auto [error, socket] = co_await acceptor_.async_accept(asio::as_tuple(asio::use_awaitable));
    if (error == asio::error::operation_aborted) co_return;
    if (error) {  // out of descriptors, or a peer that left before it was accepted
      spdlog::warn("accept on {}: {}", text(endpoint()), error.message());
      co_await clock_.sleep_for(std::chrono::milliseconds{50});
      continue;
    }
    on_connection(std::move(socket));
  }
}

tcp::endpoint parse_endpoint(const std::string& text) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos) throw std::invalid_argument{"'" + text + "' is not ADDR:PORT, e.g. 127.0.0.1:8080"};
  std::string host = text.substr(0, colon);
  if (host.size() > 1 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  if (host == "localhost") host = "127.0.0.1";
  boost::system::error_code error;
  const auto address = asio::ip::make_address(host, error);
  if (error) throw std::invalid_argument{"'" + host + "' in '" + text + "' is not an IP address"};
  unsigned port = 0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data() + colon + 1, end, port);
  if (code != std::errc{} || rest != end || port > 65535) {
    throw std::invalid_argument{"the port of '" + text + "' is not a number from 0 to 65535"};
  }
  return {address, static_cast<asio::ip::port_type>(port)};
}

std::string text(const tcp::endpoint& endpoint) {
  std::ostringstream out;
  out << endpoint;
  return out.str();
}

}  // namespace server
