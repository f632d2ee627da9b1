// Reads a scenario from TOML.
#include "sim_robot/scenario/scenario.hpp"

#include <fstream>
#include <sstream>

#include "base/field_reader.hpp"
#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

constexpr std::size_t kMaxBytes = 1'000'000;

toml::table parsed(std::string_view text, const std::string& name) {
  if (text.size() > kMaxBytes) {
    base::throw_invalid(name, ": has ", text.size(), " bytes, allowed are ", kMaxBytes);
  }
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    const toml::source_position at = error.source().begin;
    base::throw_invalid(name, ":", at.line, ":", at.column, ": ", error.description());
  }
}

}  // namespace

Scenario parse_scenario(std::string_view text, const std::string& name) {
  const toml::table table = parsed(text, name);
  Scenario scenario;
  scenario.name = std::filesystem::path{name}.stem().string();
  base::FieldReader reader{table, name};
  fields(reader, scenario);
  reader.finish();
  return scenario;
}

Scenario load_scenario(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  std::ostringstream text;
  if (!std::filesystem::is_regular_file(file) || !(stream && text << stream.rdbuf())) {
    base::throw_invalid("scenario '", file.string(), "' cannot be read");
  }
  return parse_scenario(text.str(), file.string());
}

Scenario find_scenario(const std::string& name_or_file) {
  std::string names;
  for (const base::EmbeddedFile& shipped : scenario_files()) {
    if (shipped.name == name_or_file) return parse_scenario(shipped.content, std::string(shipped.name) + ".toml");
    names += (names.empty() ? "" : ", ") + std::string(shipped.name);
  }
  if (std::filesystem::is_regular_file(name_or_file)) return load_scenario(name_or_file);
  base::throw_invalid("there is no scenario '", name_or_file, "', neither a file nor one of ", names);
}

}  // namespace sim_robot
