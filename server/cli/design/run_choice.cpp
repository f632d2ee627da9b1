// Flags, and the reading itself.
#include "server/cli/design/run_choice.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <type_traits>

#include "server/api/bodies/controller_body.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/runs/run_queries.hpp"

namespace server::cli {
namespace {

// Reads from the store by `read(database)`.
template <class Read>
auto read_from(const RunChoice& choice, Read read) {
  std::invoke_result_t<Read, SQLite::Database&> value;
  auto work = [&](SQLite::Database& database, const std::string&) -> Result<void> {
    value = read(database);
    return {};
  };
  const auto done = storage::read_store(choice.data_dir / "station.sqlite", work);
  if (!done) throw std::runtime_error{done.error().detail};
  return value;
}

}  // namespace

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
  const auto read = [&](SQLite::Database& database) { return storage::read_reference(database, choice.run.value()); };
  return read_from(choice, read);
}

analysis::RunSamples read_run_samples(const RunChoice& choice) {
  const auto read = [&](SQLite::Database& database) {
    return storage::read_interrupted_parts(database, choice.run.value());
  };
  return {read_samples(choice), read_reference(choice), read_from(choice, read)};
}

std::optional<std::uint32_t> read_controller_checksum(const RunChoice& choice) {
  const auto snapshot = read_from(
      choice, [&](SQLite::Database& database) { return storage::read_snapshot(database, choice.run.value()); });
  if (!snapshot || snapshot->controller_checksum == 0) return std::nullopt;
  return snapshot->controller_checksum;
}

std::optional<protocol::Controller> read_controller(const RunChoice& choice, std::uint32_t span, std::uint64_t seq) {
  const auto snapshot = read_from(
      choice, [&](SQLite::Database& database) { return storage::read_snapshot(database, choice.run.value()); });
  nlohmann::json content;
  for (const storage::InForce& document : snapshot ? snapshot->in_force : std::vector<storage::InForce>{}) {
    const bool is_earlier = document.span == span && document.first_seq <= seq;
    if (document.kind == "controller" && is_earlier) content = nlohmann::json::parse(document.content, nullptr, false);
  }
  if (!content.is_object()) return std::nullopt;
  const nlohmann::json body{{"controller", content}};
  const auto controller = api::controller_from(api::Members{body}, nullptr);
  return controller ? std::optional{*controller} : std::nullopt;
}

}  // namespace server::cli
