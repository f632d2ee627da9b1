// JSON of a note.
#include "server/station/state/audit_note.hpp"

#include <nlohmann/json.hpp>

namespace server::station {

std::string audit_detail(const nlohmann::json& detail) {
  return detail.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace server::station
