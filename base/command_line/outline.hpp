// What a CLI11 definition says about commands and options, in the form that help, completions and manual pages need.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace base::command_line {

// "rheonaut robot list": the names from the program on.
std::string full_name(const CLI::App& command);

// Its commands, and those options that are given by a name and those that are not; hidden ones (group "") left out.
std::vector<const CLI::App*> commands_of(const CLI::App& command);
std::vector<const CLI::Option*> options_of(const CLI::App& command);
std::vector<const CLI::Option*> arguments_of(const CLI::App& command);

// "-h", "--csv", "--no-offset": as a person types them, the short ones first.
std::vector<std::string> names_of(const CLI::Option& option);

bool takes_value(const CLI::Option& option);

// The words that it allows, from the description "{a,b}" of its validator; empty: any value.
std::vector<std::string> words_of(const CLI::Option& option);

// What stands for its value: "N", "X", "TEXT", or the words "a|b"; empty for a flag.
std::string value_of(const CLI::Option& option);

// "required; not with --run, --plan"; empty: nothing.
std::string conditions_of(const CLI::Option& option);

// The description with conditions and whether it may be repeated.
std::string meaning_of(const CLI::Option& option);

// The footer: its lines that begin with "Example: " without these words; the indented lines of a block that is headed
// "Examples:", without the first two blanks; and the others as one paragraph.
struct Footer {
  std::vector<std::string> examples;
  std::vector<std::string> block;
  std::string remarks;
};
Footer footer_of(const CLI::App& command);

}  // namespace base::command_line
