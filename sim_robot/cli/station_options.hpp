// The flags of rheonaut-sim that choose the station: by address and trust, or by its data folder on this machine.
#pragma once

#include <optional>
#include <string>

#include "sim_robot/client/dialling.hpp"

namespace CLI {
class App;
}

namespace sim_robot {

struct StationOptions {
  std::string address;  // ADDR:PORT; empty: that of the station in `data_dir`
  std::string data_dir;
  std::optional<std::string> pin, authority;  // neither: plain TCP, or the certificate that the data folder names
};

void add_station(CLI::App& app, StationOptions& options);

// Throws std::invalid_argument that names the option, and std::runtime_error when no station runs in the data folder.
// CLI::RequiredError: neither was given.
StationAddress station_address(const StationOptions& options);

}  // namespace sim_robot
