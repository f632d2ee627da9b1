// Lists, shows and checks scenarios.
#include "sim_robot/cli/scenarios_command.hpp"

#include <CLI/CLI.hpp>
#include <iomanip>
#include <iostream>

#include "sim_robot/scenario/scenario.hpp"
#include "sim_robot/scenario/scenario_tables.hpp"

namespace sim_robot {

ScenariosCommand::ScenariosCommand(CLI::App& app)
    : command_(app.add_subcommand("scenarios", "list the scenarios that come with the program")) {
  auto* show = command_->add_option("--show", shown_, "print the file of one, to begin your own with");
  command_->add_option("--check", checked_, "check a file, and say nothing when it is right")->excludes(show);
  command_->add_flag("--keys", keys_, "print every key that a file may have, as docs/scenarios.md does");
}

bool ScenariosCommand::chosen() const { return command_->parsed(); }

int ScenariosCommand::run() const {
  if (keys_) {
    std::cout << scenario_tables();
    return EXIT_SUCCESS;
  }
  if (!checked_.empty()) {
    load_scenario(checked_);
    return EXIT_SUCCESS;
  }
  if (!shown_.empty()) find_scenario(shown_);  // says which there are
  for (const base::EmbeddedFile& shipped : scenario_files()) {
    if (shown_ == shipped.name) std::cout << shipped.content;
    if (!shown_.empty()) continue;
    const Scenario scenario = find_scenario(std::string(shipped.name));
    std::cout << std::left << std::setw(24) << shipped.name << scenario.description << '\n';
  }
  return EXIT_SUCCESS;
}

}  // namespace sim_robot
