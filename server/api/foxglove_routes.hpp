// The link by which a Foxglove client comes in: who makes one, and who is let in by one.
//
// POST /api/v1/foxglove-links makes a link with a one-time ticket (identity/tickets.hpp), which /foxglove lets in once.
// SAFETY: a page of any origin may open /foxglove, since nothing but the ticket admits there: cookie and token are not
// looked at, so that a browser adds nothing to what the page itself knows. All of it is 404 `foxglove_off` unless
// foxglove.enabled is true. Loop thread; what the parts refer to outlives the routes.
#pragma once

#include "server/api/foxglove_socket.hpp"
#include "server/api/routes/routes.hpp"
#include "server/http/router.hpp"
#include "server/http/upgrade.hpp"
#include "server/identity/tickets.hpp"

namespace server::api {

struct FoxgloveRoutes {
  bool is_enabled = false;
  FoxgloveClients& clients;
  identity::Tickets& tickets;
  const StationFacts& facts;
};

void add_foxglove_routes(http::Router& router, const FoxgloveRoutes& parts);

// The upgrade of /foxglove to a WebSocket.
http::Upgrade foxglove_upgrade(const FoxgloveRoutes& parts);

}  // namespace server::api
