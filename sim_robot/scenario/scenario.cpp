// Reads a scenario from TOML.
#include "sim_robot/scenario/scenario.hpp"

#include <cstddef>

#include "base/field_reader.hpp"
#include "base/invalid_argument.hpp"
#include "base/toml_text.hpp"
#include "base/whole_file.hpp"

namespace sim_robot {
Scenario parse_scenario(std::string_view text, const std::string& name) {
  const toml::table table = base::parse_toml(text, name);
  Scenario scenario;
  scenario.name = std::filesystem::path{name}.stem().string();
  base::FieldReader reader{table, name};
  fields(reader, scenario);
  reader.finish();
  return scenario;
}

Scenario load_scenario(const std::filesystem::path& file) {
  constexpr std::size_t kMaxBytes = 1 << 20;
  if (!std::filesystem::is_regular_file(file)) base::throw_invalid("scenario '", file.string(), "' cannot be read");
  const base::WholeFile whole = base::read_whole(file, kMaxBytes);
  if (!whole.problem.empty()) base::throw_invalid("scenario '", file.string(), "' ", whole.problem);
  return parse_scenario(whole.text, file.string());
}

Scenario find_scenario(const std::string& name_or_file) {
  std::vector<std::string> names;
  for (const base::EmbeddedFile& shipped : scenario_files()) {
    if (shipped.name == name_or_file) return parse_scenario(shipped.content, std::string(shipped.name) + ".toml");
    names.emplace_back(shipped.name);
  }
  if (std::filesystem::is_regular_file(name_or_file)) return load_scenario(name_or_file);
  base::throw_invalid("there is no scenario '", name_or_file, "', neither a file nor one of ", base::list_of(names),
                      base::did_you_mean(name_or_file, names));
}

}  // namespace sim_robot
