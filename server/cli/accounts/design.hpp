// `rheonaut design`: the models and controllers that a running station keeps.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace server::cli {

struct DesignCommand {
  enum class Act : std::uint8_t { list, save, show, export_document, compare };
  Act act = Act::list;
  std::filesystem::path data_dir = "rheonaut-data";
  std::optional<std::filesystem::path> file;  // of save: what the tools printed; "-": standard input
  std::optional<std::int64_t> job;            // instead: its result
  std::string kind, name, notes;
  std::optional<std::int64_t> parent, model;
  std::vector<std::int64_t> runs;     // of save: found from them; of list: at most one
  std::vector<std::int64_t> designs;  // of show and export one, of compare some
  bool json = false;
};

void add_options(CLI::App& command, DesignCommand& options);

// Asks the station that runs in the folder. Throws std::runtime_error saying what it refused.
int run(const DesignCommand& options, std::ostream& out);

}  // namespace server::cli
