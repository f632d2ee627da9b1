// The one type of connection that HTTP and WebSocket are compiled for.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <string>

namespace server {

using HttpStream = boost::asio::ip::tcp::socket;

// Of the client, without its port; empty when it has gone already.
inline std::string address_of(const HttpStream& stream) {
  boost::system::error_code gone;
  const auto endpoint = stream.remote_endpoint(gone);
  return gone ? std::string{} : endpoint.address().to_string();
}

}  // namespace server
