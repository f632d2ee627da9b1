// `rheonaut login-link`: a one-time link of the station that runs in a data folder, for a browser to sign in with.
#pragma once

#include <filesystem>
#include <iosfwd>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct LoginLink {
  std::filesystem::path data_dir = "rheonaut-data";
  OutputForm form;
};

void add_options(CLI::App& command, LoginLink& options);

// Throws std::runtime_error saying why there is no link.
int run(const LoginLink& options, std::ostream& out);

}  // namespace server::cli
