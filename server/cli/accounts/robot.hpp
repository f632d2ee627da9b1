// `rheonaut robot`: which robots may connect, each with a token of its own, and which are out of use; with a running
// station and without one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>

#include "server/cli/accounts/robot_reservations.hpp"
#include "server/cli/accounts/robot_settings.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct RobotCommand {
  enum class Act : std::uint8_t { enrol, list, revoke, retire, unretire };
  Act act = Act::list;
  std::filesystem::path data_dir = "rheonaut-data";
  std::string robot_id;
  bool json = false;
  RobotSettingsCommand settings;         // runs instead, unless its `of` is nothing
  RobotReservationCommand reservations;  // runs instead, unless its `act` is nothing
};

void add_options(CLI::App& command, RobotCommand& options);

// `enrol` prints the robot's token and where it belongs; nobody can read it again. Throws std::runtime_error saying
// why nothing was changed.
int run(const RobotCommand& options, std::ostream& out);

}  // namespace server::cli
