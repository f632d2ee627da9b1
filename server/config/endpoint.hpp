// Addresses and ports as text: "127.0.0.1:8080", "[::1]:8080".
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <string>

namespace server::config {

// "localhost" stands for 127.0.0.1. Throws std::invalid_argument that quotes the text.
boost::asio::ip::tcp::endpoint parse_endpoint(const std::string& text);
std::string text(const boost::asio::ip::tcp::endpoint& endpoint);

std::string host_of(const std::string& peer);  // without the port, or all of it where there is none

// What counts as one address of unauthenticated peers: an IPv6 network of 64 bits belongs to one customer.
std::string network_of(const std::string& address);

}  // namespace server::config
