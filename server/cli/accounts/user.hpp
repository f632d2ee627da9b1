// `rheonaut user`: who may sign in to a station, and what they may do; with a running station and without one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>

#include "server/identity/account.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct UserCommand {
  enum class Act : std::uint8_t { add, list, remove, password, role, disable, enable };
  Act act = Act::list;
  std::filesystem::path data_dir = "rheonaut-data";
  std::string name;
  identity::Role role = identity::Role::viewer;
  bool json = false;
};

void add_options(CLI::App& command, UserCommand& options);

// A password is read from the terminal or standard input, never from an argument. Throws std::runtime_error saying why
// nothing was changed.
int run(const UserCommand& options, std::ostream& out);

}  // namespace server::cli
