// An entry for the audit: who did what, from where, when, and with which result.
//
// Plain values. Code that acts on behalf of somebody gets an Author and makes an AuditNote of it; the recorder, or the
// store that changes the database, appends the note (storage/audit/audit_chain).
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace server::station {

struct Author {
  std::string actor;       // "user:anna/session:4", "token:ci", "station", "loopback", "cli:root"; empty: nobody said
  std::string peer;        // the address it came from; empty: from no other machine, or not known
  std::int64_t at_us = 0;  // UTC
  std::string client{};    // the id of its tab or tool; empty: it gave none
};

struct AuditNote {
  Author by;
  std::string robot_id;       // empty: the station itself
  std::string action;         // of a fixed set: docs/database.md
  std::string subject;        // what it was done to: the id of a command or run, the name of a user or token
  std::string detail = "{}";  // a JSON object
  bool can_flood = false;     // anybody can cause any number of it: AuditQuota bounds how many are written
};

// As text for `detail`; what is not UTF-8 is replaced.
std::string audit_detail(const nlohmann::json& detail);

}  // namespace server::station
