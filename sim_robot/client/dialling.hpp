// Where a station is, and how to get there within a time.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <memory>
#include <string>

#include "sim_robot/client/station_trust.hpp"

namespace sim_robot {

struct StationAddress {
  std::string host;
  std::string port;
  std::shared_ptr<const StationTrust> trust{};  // null: plain TCP
};
// "host:port" or "[v6]:port"; throws std::invalid_argument that names the option.
StationAddress parse_station_address(const std::string& text, const std::string& option = "--station",
                                     int lowest_port = 1);

boost::asio::awaitable<void> pause(std::chrono::milliseconds duration);

// Connects the socket, without delay of small writes; false when it cannot, or not within the limit for each of
// resolving and connecting. An address in numbers needs no resolver, which would serve a fleet one by one.
boost::asio::awaitable<bool> dial(boost::asio::ip::tcp::socket& socket, StationAddress address,
                                  std::chrono::milliseconds limit);

}  // namespace sim_robot
