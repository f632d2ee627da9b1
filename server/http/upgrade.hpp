// The paths where a connection may be upgraded from HTTP, and the code that takes it over.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>
#include <cstddef>
#include <expected>
#include <functional>
#include <map>
#include <string>

#include "server/http/http.hpp"
#include "server/http/http_stream.hpp"
#include "server/identity/caller.hpp"

namespace server::http {

using UpgradeRequest = boost::beast::http::request<boost::beast::http::empty_body>;

struct Upgrade {
  // Ends when the connection does. Throws operation_aborted when cancelled.
  std::function<boost::asio::awaitable<void>(HttpStream, UpgradeRequest, identity::Caller)> serve;
  // Who is let in by the request itself, in place of the caller that RequestGuard knows, or the refusal. Called once,
  // when the upgrade is about to be made. Null: RequestGuard lets in.
  std::function<std::expected<identity::Caller, Response>(const Request&)> admit = nullptr;
};

// Outlives the connections.
struct Upgrades {
  std::map<std::string, Upgrade> at;             // by path
  std::map<std::string, std::size_t> open = {};  // connections, by path and user, token or link
};

}  // namespace server::http
