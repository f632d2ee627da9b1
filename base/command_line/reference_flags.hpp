// --man and --completion, for a program that has no commands for them.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "base/command_line/manual.hpp"

namespace base::command_line {

// The flags print what they name, made from the whole definition of `app`, and end the parsing with CLI::Success.
void add_reference_flags(CLI::App& app, const std::string& version, const std::vector<ManualSection>& sections);

}  // namespace base::command_line
