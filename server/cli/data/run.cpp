// Two requests: what is missing, and that it is given up.
#include "server/cli/data/run.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
using nlohmann::json;

void add_options(CLI::App& command, RunCommand& options) {
  command.require_subcommand(1);
  CLI::App* sub = command.add_subcommand("finalize", "Give up what is missing of a run whose robot does not come back");
  sub->add_option("run", options.run, "Its number")
      ->required()
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  sub->add_option("--samples", options.samples,
                  "So many are missing and are given up, for good; without it the command says how many those are");
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->footer("Example: rheonaut run finalize 3 --samples 800 --data lab");
  command.footer("Example: rheonaut run finalize 3 --data lab");
}

int run(const RunCommand& options, std::ostream& out) {
  const StationClient station{options.data_dir};
  const std::string target = fmt::format("/api/v1/runs/{}", options.run);
  json digest;
  if (options.samples) {
    digest = asked(station.ask("POST", target + "/finalize", {{"samples_missing", *options.samples}}));
  } else {
    digest = asked(station.ask("GET", target + "/certificate"));
    digest["samples_given_up"] = 0;
  }
  const auto missing = digest.at("samples_missing").get<std::uint64_t>();
  if (!options.samples && missing > 0) {
    throw std::runtime_error{
        fmt::format("{0} samples of run {1} are missing; its robot may still send them. To give them up for good: "
                    "rheonaut run finalize {1} --samples {0}",
                    missing, options.run)};
  }
  if (options.json) {
    fmt::print(out, "{}\n", digest.dump(2));
  } else if (digest.at("final").get<bool>()) {
    fmt::print(out, "Run {} is final: {} samples were given up now\nSHA-256 {}\n", options.run,
               digest.at("samples_given_up").get<std::uint64_t>(), digest.at("sha256").get<std::string>());
  } else {
    fmt::print(out, "Run {}: {} samples were given up now; its digest is being made\n", options.run,
               digest.at("samples_given_up").get<std::uint64_t>());
  }
  return 0;
}

}  // namespace server::cli
