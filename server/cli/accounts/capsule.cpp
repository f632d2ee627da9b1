// One request, and a file.
#include "server/cli/accounts/capsule.hpp"

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

void add_options(CLI::App& command, CapsuleQuestion& options) {
  command.add_option("run", options.run, "The number of a run that has ended")
      ->required()
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  command.add_option("--to", options.file, "The archive; one that is there is replaced")->required()->check(named());
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  command.footer("Example: rheonaut capsule 1 --to run-1.eln --data lab");
}

int run(const CapsuleQuestion& options, std::ostream& out) {
  const StationAnswer answer =
      StationClient{options.data_dir}.ask("GET", fmt::format("/api/v1/runs/{}/capsule.eln", options.run));
  if (answer.status != 200) {
    throw std::runtime_error{fmt::format("the station refused: {}", answer.body.value("detail", "no reason"))};
  }
  const storage::Draft draft{std::filesystem::path{options.file}.concat(".part")};
  std::ofstream file{draft.path(), std::ios::binary};
  if (!(file << answer.text && file.flush())) {
    throw std::runtime_error{fmt::format("cannot write '{}'", draft.path().string())};
  }
  file.close();
  storage::finish_file(draft.path(), options.file);
  fmt::print(out, "{} ({} bytes)\n", options.file.string(), answer.text.size());
  return 0;
}

}  // namespace server::cli
