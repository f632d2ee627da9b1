// Flags, and the reading itself.
#include "server/cli/design/run_choice.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <stdexcept>

#include "server/cli/terminal/options.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::cli {

void add_options(CLI::App& command, RunChoice& choice) {
  auto* run = command.add_option("--run", choice.run, "A recorded run by its number");
  run->check(whole(1, std::numeric_limits<storage::RunId>::max()));
  command.add_option("--data", choice.data_dir, "Folder of the station that recorded it (default: rheonaut-data)")
      ->check(named())
      ->needs(run);
}

std::vector<storage::StoredSample> read_samples(const RunChoice& choice) {
  auto samples =
      storage::read_run(choice.data_dir / "station.sqlite", choice.run.value(), analysis::kMaxAnalysedSamples);
  if (!samples) throw std::runtime_error{samples.error().detail};
  return std::move(*samples);
}

std::optional<storage::StoredReference> read_reference(const RunChoice& choice) {
  std::optional<storage::StoredReference> stored;
  auto read = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    stored = storage::read_reference(database, choice.run.value());
    return {};
  };
  const auto done = storage::read_store(choice.data_dir / "station.sqlite", read);
  if (!done) throw std::runtime_error{done.error().detail};
  return stored;
}

}  // namespace server::cli
