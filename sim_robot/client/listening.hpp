// A port of this program to listen on.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

namespace sim_robot {

// Listens at once; port 0 is any free one. Throws std::runtime_error in one sentence, also where the port is taken.
boost::asio::ip::tcp::acceptor listen_on(boost::asio::io_context& loop, const boost::asio::ip::tcp::endpoint& at);

}  // namespace sim_robot
