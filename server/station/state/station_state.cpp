#include "server/station/state/station_state.hpp"

namespace server::station {

const char* text(LinkState value) { return value == LinkState::connected ? "connected" : "disconnected"; }

const char* text(ModelState value) {
  switch (value) {
    case ModelState::assumed: return "assumed";
    case ModelState::sending: return "sending";
    case ModelState::confirmed: return "confirmed";
    case ModelState::failed: break;
  }
  return "failed";
}

const char* text(CommandState value) {
  switch (value) {
    case CommandState::queued: return "queued";
    case CommandState::sent: return "sent";
    case CommandState::acknowledged: return "acknowledged";
    case CommandState::verified: return "verified";
    case CommandState::rejected: return "rejected";
    case CommandState::expired: return "expired";
    case CommandState::failed: return "failed";
    case CommandState::superseded: return "superseded";
    case CommandState::unknown: break;
  }
  return "unknown";
}

}  // namespace server::station
