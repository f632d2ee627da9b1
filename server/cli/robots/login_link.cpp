// One request to the station.
#include "server/cli/robots/login_link.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {

void add_options(CLI::App& command, LoginLink& options) {
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_json_flag(command, options.form);
  command.footer(
      "The link signs one browser in, as admin; it works once, and for 10 minutes. It has\n"
      "this machine's address: for a browser elsewhere put the station's name in its place.\n"
      "Example: rheonaut login-link --data lab");
}

int run(const LoginLink& options, std::ostream& out) {
  const nlohmann::json link = asked(StationClient{options.data_dir}.ask("POST", "/api/v1/login-links"));
  fmt::print(out, "{}\n", options.form.is_json ? link.dump(2) : link.at("url").get<std::string>());
  return 0;
}

}  // namespace server::cli
