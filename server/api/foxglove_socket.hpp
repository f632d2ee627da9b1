// One Foxglove client on /foxglove: sends what it has subscribed to, and receives subscriptions alone.
//
// One reader and one writer. What waits for it is bounded (OutgoingQueue: the oldest samples are dropped, and it gets a
// status). A message of a client has at most 4 kB, or the connection ends with the WebSocket's code 1009. It ends as
// well when the client falls silent or does not read (PeerWatch), and with the session or token of who made its ticket.
// Loop thread; the parts outlive the connection.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <string>

#include "server/api/live_messages.hpp"
#include "server/http/upgrade.hpp"
#include "server/identity/caller.hpp"
#include "server/live/foxglove/feed.hpp"

namespace server::api {

// The sub-protocol to be spoken, of those that a client offers in Sec-WebSocket-Protocol; empty: none is known. Both
// that are known get the same messages.
std::string foxglove_protocol(const std::string& offered);

// Everything outlives every client.
struct FoxgloveClients {
  LiveParts& live;
  live::foxglove::Feed& feed;
  std::string station_start;  // another one after each start of the station
};

// Ends when the client leaves or falls silent. Throws operation_aborted when cancelled.
boost::asio::awaitable<void> serve_foxglove(http::HttpStream stream, http::UpgradeRequest upgrade,
                                            identity::Caller caller, FoxgloveClients& clients);

}  // namespace server::api
