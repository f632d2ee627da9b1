// Makes a trust of the flags.
#include "sim_robot/cli/tls_options.hpp"

#include <CLI/CLI.hpp>

namespace sim_robot {

void add_tls(CLI::App& app, TlsOptions& options) {
  app.add_option("--tls-pin", options.pin,
                 "TLS with the station whose key has this SHA-256, as its certificate is made")
      ->type_name("SHA256");
  app.add_option("--tls-ca", options.authority, "TLS with a station that one of these certificates vouches for")
      ->type_name("FILE");
}

StationAddress station_address(const std::string& text, const TlsOptions& options) {
  StationAddress station = parse_station_address(text);
  if (options.pin || options.authority) {
    station.trust = std::make_shared<const StationTrust>(options.pin, options.authority, station.host);
  }
  return station;
}

}  // namespace sim_robot
