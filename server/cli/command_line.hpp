// What the user asked for on the command line.
#pragma once

#include <variant>

#include "server/config.hpp"

namespace server::cli {

struct Serve {
  ConfigFlags flags;
};

struct CheckConfig {
  ConfigFlags flags;
};

// The user was answered already (--help, --version, or a mistake that was explained).
struct Answered {
  int exit_code = 0;
};

using Wish = std::variant<Serve, CheckConfig, Answered>;

Wish parse_command_line(int argc, char** argv);

// Reads and checks a configuration, and prints what it means. Returns the exit code.
int check_config(const CheckConfig& wish);

}  // namespace server::cli
