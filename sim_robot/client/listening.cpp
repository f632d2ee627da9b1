// What the operating system says, in words.
#include "sim_robot/client/listening.hpp"

#include <sstream>
#include <stdexcept>

namespace sim_robot {

namespace asio = boost::asio;
using asio::ip::tcp;

tcp::acceptor listen_on(asio::io_context& loop, const tcp::endpoint& at) {
  tcp::acceptor acceptor{loop, at.protocol()};
  acceptor.set_option(tcp::acceptor::reuse_address{true});
  boost::system::error_code error;
  acceptor.bind(at, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (!error) return acceptor;
  std::ostringstream text;
  text << "cannot listen on " << at << ": "
       << (error == asio::error::address_in_use ? "another program listens there; stop it, or choose another port"
                                                : error.message());
  throw std::runtime_error(text.str());
}

}  // namespace sim_robot
