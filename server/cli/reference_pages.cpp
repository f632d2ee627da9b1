// What the definition of the command line does not say is added here: exit statuses and files.
#include "server/cli/reference_pages.hpp"

#include <CLI/CLI.hpp>
#include <ostream>
#include <stdexcept>

#include "base/command_line/completion.hpp"
#include "base/command_line/manual.hpp"
#include "base/version.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

std::vector<base::command_line::ManualSection> sections() {
  base::command_line::ManualSection statuses{"EXIT STATUS", {}};
  for (const ExitStatus& status : kExitStatuses) {
    statuses.entries.emplace_back(std::to_string(status.code), status.meaning);
  }
  return {statuses,
          {"FILES",
           {{"FOLDER/station.sqlite", "everything that the station of --data FOLDER has recorded"},
            {"FOLDER/rheonaut.token", "the station's own token, by which the commands act"},
            {"FOLDER/endpoints.json", "where the running station listens"}}}};
}

}  // namespace

void add_options(CLI::App& command, CompletionCommand& options) {
  command.add_option("shell", options.shell, "The shell")->required()->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command.footer(
      "bash: put it into ~/.local/share/bash-completion/completions/rheonaut; zsh: into a folder of fpath as "
      "_rheonaut;\n"
      "fish: into ~/.config/fish/completions/rheonaut.fish.\n"
      "Example: rheonaut completion bash");
}

void add_options(CLI::App& command, ManualCommand& options) {
  CLI::Option* page =
      command.add_option("command", options.command, "The command; without it the program's own page")->check(named());
  command.add_flag("--list", options.is_list, "The names of all pages, one on each line")->excludes(page);
  command.footer(
      "The page is for man(1): rheonaut man stop | man -l -\n"
      "Example: rheonaut man stop");
}

void write(const CompletionCommand& options, const CLI::App& app, std::ostream& out) {
  out << base::command_line::completion_script(app, options.shell);
}

void write(const ManualCommand& options, const CLI::App& app, std::ostream& out) {
  using namespace base::command_line;
  if (options.is_list) {
    for (const std::string& name : manual_pages(app)) out << name << '\n';
    return;
  }
  try {
    out << manual_page(app, Pages::of_each_command, options.command, base::version(), sections());
  } catch (const std::invalid_argument& error) {
    throw UsageError{error.what()};
  }
}

}  // namespace server::cli
