// The text of --help: usage, arguments, options and commands by group, at most 80 columns wide.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace base::command_line {

// For CLI::App::formatter, before any command is added: each command takes it from its parent.
std::shared_ptr<CLI::FormatterBase> help_formatter();

}  // namespace base::command_line
