// One request, and a file.
#include "server/cli/analysis/capsule.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <limits>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {

void add_options(CLI::App& command, CapsuleQuestion& options) {
  command.add_option("run", options.run, "The number of a run that has ended")
      ->required()
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_option("--to", options.file, "The archive; one that is there is replaced")->required()->check(named());
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_timeout_option(command, options.timeout_s);
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut capsule 1 --to run-1.eln --data lab");
}

int run(const CapsuleQuestion& options, std::ostream& out) {
  const Progress progress{"capsule: the station computes it", options.form};
  StationClient{options.data_dir}.save(fmt::format("/api/v1/runs/{}/capsule.eln", options.run), options.file,
                                       timeout(options.timeout_s));
  const auto size_bytes = std::filesystem::file_size(options.file);
  if (options.form.is_json) {
    write_json(out, {{"run_id", options.run}, {"file", options.file.string()}, {"size_bytes", size_bytes}});
  } else {
    fmt::print(out, "{} ({} bytes)\n", options.file.string(), size_bytes);
  }
  return 0;
}

}  // namespace server::cli
