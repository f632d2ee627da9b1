// `rheonaut robot reserve`, `reservations` and `cancel-reservation`: time slots in which one account alone commands a
// robot of the running station.
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

struct RobotReservationCommand {
  enum class Act : std::uint8_t { nothing, reserve, list, cancel };
  Act act = Act::nothing;
  std::filesystem::path data_dir = "rheonaut-data";
  std::string robot_id;  // list: empty: all
  std::int64_t reservation = 0;
  std::optional<std::int64_t> from_us;  // UTC; none: now
  std::int64_t for_s = 0;
  std::string purpose, holder;
  bool with_over = false;
  bool json = false;
};

// `robot` is the command whose subcommands they are.
void add_options(CLI::App& robot, RobotReservationCommand& options);

// Throws std::runtime_error saying what the station refused.
int run(const RobotReservationCommand& options, std::ostream& out);

// "2h", "90min", "30s", "1d", "1h30min"; none: it is no such text, or 0.
std::optional<std::int64_t> seconds_of(const std::string& duration);
// "2026-11-26T09:00Z" or with seconds, UTC; none: it is no such text.
std::optional<std::int64_t> utc_us_of(const std::string& time);

}  // namespace server::cli
