// One request, and a file.
#include "server/cli/analysis/report.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <limits>

#include "server/analysis/comparison/aligned_runs.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {

void add_options(CLI::App& command, ReportQuestion& options) {
  command.add_option("run", options.runs, "The number of a run, or of 2 to 12 to compare")
      ->required()
      ->expected(1, static_cast<int>(analysis::kMostAlignedRuns))
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_option("--to", options.file, "The HTML file; one that is there is replaced")->required()->check(named());
  add_options(command, options.traces);
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_timeout_option(command, options.timeout_s);
  add_json_flag(command, options.form);
  command.footer(
      "The options of the alignment are those of several runs.\n"
      "Example: rheonaut report 1 2 3 --at step --to steps.html --data lab");
}

int run(const ReportQuestion& options, std::ostream& out) {
  const std::string target = options.runs.size() == 1 ? fmt::format("/api/v1/runs/{}/report.html", options.runs.front())
                                                      : fmt::format("/api/v1/run-comparison/report.html?{}",
                                                                    query_of(options.runs, options.traces));
  const Progress progress{"report: the station computes it", options.form};
  StationClient{options.data_dir}.save(target, options.file, timeout(options.timeout_s));
  if (options.form.is_json) {
    write_json(out, {{"runs", options.runs},
                     {"file", options.file.string()},
                     {"size_bytes", std::filesystem::file_size(options.file)}});
  } else {
    fmt::print(out, "{}\n", options.file.string());
  }
  return 0;
}

}  // namespace server::cli
