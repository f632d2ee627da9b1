// What the station tells the program that started it and watches over it (systemd, Type=notify): ready, alive,
// stopping.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <string>

#include "server/runtime/clock.hpp"

namespace server::config {

// Says that the station is ready (both ports listen, what was stored is restored), then three times in each
// WATCHDOG_USEC that the loop runs, and, when it is cancelled, that the station stops. `status` is for people. Does
// nothing when nobody asks for it (no NOTIFY_SOCKET in the environment).
//
// SAFETY: a loop that stands still carries no stop; the supervisor then ends the station and starts it again. Only the
// loop counts: on a disk that does not answer the station still has to carry stops.
boost::asio::awaitable<void> tell_supervisor(runtime::Clock& clock, std::string status);

}  // namespace server::config
