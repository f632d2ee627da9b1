// A listening TCP port that passes each connection on and continues after errors of accept().
//
// Loop thread. Outlives its run(). Uses the clock to pause when the process is out of file descriptors.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <functional>

#include "server/runtime/clock.hpp"
#include "server/runtime/log.hpp"

namespace server::net {

class Listener {
 public:
  // Binds and listens at once; port 0 takes any free one. With `or_any_port` a taken port is replaced by a free one.
  // Throws boost::system::system_error that names the address.
  Listener(boost::asio::io_context& loop, runtime::Clock& clock, const boost::asio::ip::tcp::endpoint& endpoint,
           bool or_any_port = false);

  // Accepts until cancelled; `on_connection` starts a task with the socket and returns at once. Without a descriptor
  // left `give_up_one` is asked to end a connection; false: it cannot, and the port pauses.
  boost::asio::awaitable<void> run(
      std::function<void(boost::asio::ip::tcp::socket)> on_connection,
      std::function<bool()> give_up_one = [] { return false; });

  boost::asio::ip::tcp::endpoint endpoint() const { return acceptor_.local_endpoint(); }

 private:
  runtime::Clock& clock_;
  runtime::SparseLines lines_;
  boost::asio::ip::tcp::acceptor acceptor_;
};

}  // namespace server::net
