// Manual pages in roff, for man(1): one of the program and one of each of its commands.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace base::command_line {

// Sections that the definition does not say: "EXIT STATUS", "FILES" and such, each a list of a term and its meaning.
struct ManualSection {
  std::string heading;
  std::vector<std::pair<std::string, std::string>> entries;
};

// One page for everything, or one of each command as well.
enum class Pages { one, of_each_command };

// Names of all pages: "rheonaut", "rheonaut-serve", ….
std::vector<std::string> manual_pages(const CLI::App& app);

// The page of the program, or of its command `command` with the commands of that one. `sections` stand on each page.
// Throws std::invalid_argument naming a command that there is none of.
std::string manual_page(const CLI::App& app, Pages pages, const std::string& command, const std::string& version,
                        const std::vector<ManualSection>& sections);

}  // namespace base::command_line
