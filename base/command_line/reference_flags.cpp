// Prints while the arguments are parsed: by then every command is defined.
#include "base/command_line/reference_flags.hpp"

#include <iostream>

#include "base/command_line/completion.hpp"

namespace base::command_line {

void add_reference_flags(CLI::App& app, const std::string& version, const std::vector<ManualSection>& sections) {
  const auto print_manual = [&app, version, sections] {
    std::cout << manual_page(app, Pages::one, "", version, sections) << std::flush;
    throw CLI::Success{};
  };
  const auto print_completion = [&app](const std::string& shell) {
    std::cout << completion_script(app, shell) << std::flush;
    throw CLI::Success{};
  };
  app.set_version_flag("--version", version, "Print the version and exit");
  app.add_flag_callback("--man", print_manual, "Print the manual page, for man(1)");
  app.add_option_function<std::string>("--completion", print_completion, "Print the completion script for a shell")
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
}

}  // namespace base::command_line
