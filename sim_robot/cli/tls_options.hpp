// The flags of rheonaut-sim that choose the trusted station.
#pragma once

#include <optional>
#include <string>

#include "sim_robot/client/dialling.hpp"

namespace CLI {
class App;
}

namespace sim_robot {

struct TlsOptions {
  std::optional<std::string> pin, authority;  // neither: plain TCP
};

void add_tls(CLI::App& app, TlsOptions& options);

// Throws std::invalid_argument that names the option.
StationAddress station_address(const std::string& text, const TlsOptions& options);

}  // namespace sim_robot
