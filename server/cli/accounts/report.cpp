// One request, and a file.
#include "server/cli/accounts/report.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/storage/database/finished_file.hpp"

namespace server::cli {

void add_options(CLI::App& command, ReportQuestion& options) {
  command.add_option("run", options.run, "The number of a run")
      ->required()
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_option("--to", options.file, "The HTML file; one that is there is replaced")->required()->check(named());
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  command.footer("Example: rheonaut report 1 --to run-1.html --data lab");
}

int run(const ReportQuestion& options, std::ostream& out) {
  const StationAnswer answer =
      StationClient{options.data_dir}.ask("GET", fmt::format("/api/v1/runs/{}/report.html", options.run));
  if (answer.status != 200) {
    throw std::runtime_error{fmt::format("the station refused: {}", answer.body.value("detail", "no reason"))};
  }
  std::filesystem::path part = options.file;
  part += ".part";
  std::ofstream file{part, std::ios::binary};
  if (!(file << answer.text && file.flush())) {
    throw std::runtime_error{fmt::format("cannot write '{}'", part.string())};
  }
  file.close();
  storage::finish_file(part, options.file);
  fmt::print(out, "{}\n", options.file.string());
  return 0;
}

}  // namespace server::cli
