// Who acts, and by what: a credential, and one client of it, a tab or an invocation of a tool.
//
// SAFETY: a sign of life is of one client. Two tabs of one session, and two programs with one token, are two: the one
// keeps nothing moving for the other. A client chooses its id, which is worth nothing with another credential.
#pragma once

#include <string>

namespace server::station {

struct Client {
  std::string actor;  // "user:anna/session:4", "token:local"
  std::string id;     // empty: it gave none
  bool operator==(const Client&) const = default;
};

// For people: "user:anna/session:4, page 1f2e3d4c", "token:local, script 1f2e3d4c"; without an id the actor alone.
std::string text(const Client& client);

}  // namespace server::station
