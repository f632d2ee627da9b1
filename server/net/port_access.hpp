// The steps before a port serves a connection: the limits of connections, and the TLS handshake.
#pragma once

#include <cstddef>

#include "server/net/connection_limiter.hpp"
#include "server/tls/tls_handshakes.hpp"

namespace server::net {

// Outlives the connections. Not moved.
struct PortAccess {
  ConnectionLimiter limiter;
  tls::TlsHandshakes* tls = nullptr;  // null: plain TCP
  std::size_t listening = 0;          // listeners that accept connections now: 1, or 0 while it starts or stops
};

}  // namespace server::net
