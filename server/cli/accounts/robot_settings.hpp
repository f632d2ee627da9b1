// `rheonaut robot parameters`, `rheonaut robot controller` and `rheonaut robot fluid`: what is in force on a robot, and
// to change it, through the station that runs in the data folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace server::cli {

struct RobotSettingsCommand {
  enum class Of : std::uint8_t { nothing, parameters, controller, fluid };
  Of of = Of::nothing;
  std::filesystem::path data_dir = "rheonaut-data";
  std::string robot_id;
  std::string set;                     // NAME=VALUE, the file of a controller, or a fluid; empty: nothing is set
  std::optional<std::int64_t> design;  // a controller that the station keeps, to be set
  bool read_anew = false;
  bool restore = false;
  bool is_not_known = false;    // the fluid
  std::string model;            // of its fluid, to be sent: a file, or "-" for standard input; empty: none
  std::string confirm_because;  // of that model in spite of a grave doubt; empty: it is not confirmed then
  bool confirm = false;
  std::optional<double> duty_min, duty_max;
  std::string derivative_on;  // empty: as in the controller in force
  bool json = false;
};

// Adds the three as subcommands.
void add_options(CLI::App& robot, RobotSettingsCommand& options);

// 0, or kNotVerified when the robot accepted a change and has not said it back. Throws std::runtime_error saying why
// nothing was changed, or that the robot says something else than it was sent.
inline constexpr int kNotVerified = 5;
int run(const RobotSettingsCommand& options, std::ostream& out);

}  // namespace server::cli
