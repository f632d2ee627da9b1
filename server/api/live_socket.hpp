// One page on /live: sends the feed's messages, and receives emergency stops and lease renewals.
//
// One reader and one writer. The queue between feed and writer is bounded (Subscriber: oldest samples are dropped, and
// the page is notified). A message of a page has at most 4 kB, and 500 a second are read. A page is let go that is
// silent for 30 s, pings unanswered, or that does not take a message within 30 s. What the caller may not do is refused
// before anybody acts on it, and the page ends with the session or token that it rests on. Loop thread; the parts
// outlive the connection.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <string>

#include "server/api/live_messages.hpp"
#include "server/http/upgrade.hpp"
#include "server/identity/caller.hpp"

namespace server::api {

// Ends when the page leaves or falls silent. Throws operation_aborted when cancelled.
boost::asio::awaitable<void> serve_live(http::HttpStream stream, http::UpgradeRequest upgrade, identity::Caller caller,
                                        LiveParts& parts);

}  // namespace server::api
