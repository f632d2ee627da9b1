// The robot's socket to a station: TCP, or TLS over it.
//
// Reads and writes never wait; who must, waits until it is readable. What a write did not take must be what the next
// one begins with. The last TLS session is kept, so that the next handshake is short. It is moved only while nothing
// waits.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstdint>
#include <string>

#include "base/tls/wire.hpp"
#include "protocol/bytes.hpp"
#include "sim_robot/client/dialling.hpp"
#include "sim_robot/client/station_trust.hpp"

namespace sim_robot {

class StationSocket {
 public:
  explicit StationSocket(boost::asio::io_context& loop) : socket_(loop) {}

  // Dials, and shakes hands when there is a trust; empty: connected, else why not. Within `limit` each for resolving
  // and connecting, and 10 s for the handshake.
  boost::asio::awaitable<std::string> reach(StationAddress station, std::chrono::milliseconds limit);

  // False when it was cancelled or closed.
  boost::asio::awaitable<bool> wait_readable();
  base::Wire::Attempt read(std::uint8_t* into, std::size_t capacity) { return wire_.read(into, capacity); }
  base::Wire::Attempt write(protocol::Bytes bytes) { return wire_.write(bytes.first, bytes.size); }
  bool has_unread();

  void cancel();
  void close();
  // The connection as it stands, for who keeps it without a word; this one is closed then, and as new.
  boost::asio::ip::tcp::socket take();

 private:
  boost::asio::awaitable<std::string> shake_hands(StationAddress station);
  void forget_wire();

  boost::asio::ip::tcp::socket socket_;
  base::Wire wire_{-1};  // of no descriptor until it is connected
  base::Openssl<SSL_SESSION> session_;
};

}  // namespace sim_robot
