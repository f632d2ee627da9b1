// Completion scripts of bash, zsh and fish: commands, options, and the words that an option allows; else files.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <string>

namespace base::command_line {

inline constexpr std::array<const char*, 3> kShells{"bash", "zsh", "fish"};

// The script of one of kShells for the program `app`. Throws std::invalid_argument naming another shell.
std::string completion_script(const CLI::App& app, const std::string& shell);

}  // namespace base::command_line
