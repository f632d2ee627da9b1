// The one type of connection that HTTP and WebSocket are compiled for: plain or TLS.
#pragma once

#include <string>

#include "server/config/endpoint.hpp"
#include "server/tls/stream_socket.hpp"

namespace server::http {

using HttpStream = tls::StreamSocket;

// The client's address without its port.
inline std::string address_of(const HttpStream& stream) { return config::host_of(stream.peer()); }

}  // namespace server::http
