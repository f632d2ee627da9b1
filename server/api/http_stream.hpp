// The one type of connection that HTTP and WebSocket are compiled for: plain or TLS.
#pragma once

#include "server/net/stream_socket.hpp"

namespace server {

using HttpStream = StreamSocket;

}  // namespace server
