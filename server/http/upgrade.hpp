// The path where a connection may be upgraded from HTTP, and the code that takes it over.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>
#include <cstddef>
#include <functional>
#include <map>
#include <string>

#include "server/http/http_stream.hpp"
#include "server/identity/caller.hpp"

namespace server::http {

using UpgradeRequest = boost::beast::http::request<boost::beast::http::empty_body>;

// Outlives the connections.
struct Upgrades {
  std::string path;
  // Ends when the connection does. Throws operation_aborted when cancelled.
  std::function<boost::asio::awaitable<void>(HttpStream, UpgradeRequest, identity::Caller)> serve;
  std::map<std::string, std::size_t> open = {};  // connections, of each user, token or link
};

}  // namespace server::http
