// What a robot says is in force: its parameters and its controller, as JSON for the record.
//
// A robot sends both after each Welcome, and what changed after each change. Loop thread; one for each connection.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "server/station/station_state.hpp"

namespace server {

class ParameterTable {
 public:
  // Takes a page. The whole table as JSON, {"name": {"value", "unit", "minimum", "maximum", "default"}}, once every
  // parameter is known and one of them has changed; nothing before. A page that cannot be is passed over.
  std::optional<std::string> add(const protocol::ParameterPage& page);

 private:
  static constexpr std::uint32_t kMost = 256;  // parameters of a robot

  std::map<std::string, rheonaut_Parameter> parameters_;
  std::string told_;
};

// Coefficients as they were sent, in the order of the message.
std::string controller_json(const protocol::Controller& controller);

}  // namespace server
