// The one type of connection that HTTP and WebSocket are compiled for.
#pragma once

#include <boost/asio/ip/tcp.hpp>

namespace server {

using HttpStream = boost::asio::ip::tcp::socket;

}  // namespace server
