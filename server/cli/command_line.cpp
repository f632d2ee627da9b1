// The command line, by CLI11.
#include "server/cli/command_line.hpp"

#include <CLI/CLI.hpp>

#ifndef RHEONAUT_VERSION
#error "RHEONAUT_VERSION comes from CMake"
#endif

namespace server::cli {
namespace {

void add_config_flags(CLI::App& command, ConfigFlags& flags) {
  command.add_option("--config", flags.file, "Configuration file in TOML; deploy/rheonaut.toml documents every option");
  command.add_option("--data", flags.data_dir, "Folder of everything the station keeps (default: rheonaut-data)");
  command.add_option("--http", flags.http, "ADDR:PORT of the page and the API (default: 127.0.0.1:8080; port 0: any)");
  command.add_option("--robots", flags.robots, "ADDR:PORT where robots dial in (default: 127.0.0.1:7070; port 0: any)");
}

}  // namespace

Wish parse_command_line(int argc, char** argv) {
  CLI::App app{"Rheonaut, the ground station for small robots"};
  app.set_version_flag("--version", RHEONAUT_VERSION);
  app.require_subcommand(1);
  app.footer("Example: rheonaut serve --data ~/lab --robots 127.0.0.1:7070");
  ConfigFlags flags;
  auto* serve = app.add_subcommand("serve", "Run the station until SIGINT or SIGTERM");
  add_config_flags(*serve, flags);
  auto* check = app.add_subcommand("check-config", "Check a configuration and print what it means");
  add_config_flags(*check, flags);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return Answered{app.exit(error)};
  }
  if (serve->parsed()) return Serve{flags};
  return CheckConfig{flags};
}

}  // namespace server::cli
