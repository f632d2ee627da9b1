// What stands in front of a port: the door that counts, and the gate into TLS.
#pragma once

#include "server/net/door.hpp"
#include "server/tls/tls_gate.hpp"

namespace server {

// Outlives the connections. Not moved.
struct Entrance {
  Door door;
  TlsGate* tls = nullptr;  // null: plain TCP
};

}  // namespace server
