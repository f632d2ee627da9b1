// Resolves and connects, each against a timer.
#include "sim_robot/client/dialling.hpp"

#include <boost/asio/connect.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/steady_timer.hpp>
#include <stdexcept>
#include <vector>

#include "sim_robot/client/no_throw.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

// Empty when there are none.
asio::awaitable<std::vector<tcp::endpoint>> resolve(tcp::socket& socket, StationAddress address,
                                                    std::chrono::milliseconds limit) {
  boost::system::error_code error;
  const auto numbers = asio::ip::make_address(address.host, error);
  if (!error) co_return std::vector{tcp::endpoint{numbers, static_cast<std::uint16_t>(std::stoi(address.port))}};
  tcp::resolver resolver{socket.get_executor()};
  auto resolving = resolver.async_resolve(address.host, address.port, kNoThrow) || pause(limit);
  auto outcome = co_await std::move(resolving);
  if (outcome.index() == 1) co_return std::vector<tcp::endpoint>{};
  const auto& [resolve_error, results] = std::get<0>(outcome);
  if (resolve_error) co_return std::vector<tcp::endpoint>{};
  co_return std::vector<tcp::endpoint>(results.begin(), results.end());
}

}  // namespace

StationAddress parse_station_address(const std::string& text, const std::string& option, int lowest_port) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size()) {
    throw std::invalid_argument(option + ": '" + text + "' is not ADDR:PORT");
  }
  std::string host = text.substr(0, colon);
  if (host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  const std::string port = text.substr(colon + 1);
  if (port.size() > 5 || port.find_first_not_of("0123456789") != std::string::npos || std::stoi(port) > 65535 ||
      std::stoi(port) < lowest_port) {
    throw std::invalid_argument(option + ": '" + port + "' is not a port");
  }
  return {host, port, nullptr};
}

asio::awaitable<void> pause(std::chrono::milliseconds duration) {
  asio::steady_timer timer{co_await asio::this_coro::executor, duration};
  co_await timer.async_wait(kNoThrow);
}

asio::awaitable<bool> dial(tcp::socket& socket, StationAddress address, std::chrono::milliseconds limit) {
  const std::vector<tcp::endpoint> endpoints = co_await resolve(socket, std::move(address), limit);
  if (endpoints.empty()) co_return false;
  auto connecting = asio::async_connect(socket, endpoints, kNoThrow) || pause(limit);
  auto outcome = co_await std::move(connecting);
  if (outcome.index() == 1 || std::get<0>(std::get<0>(outcome))) co_return false;
  boost::system::error_code error;
  socket.set_option(tcp::no_delay{true}, error);
  co_return !error;
}

}  // namespace sim_robot
