// "did you mean": the command or option that a misspelt word is nearest to.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace base::command_line {

inline constexpr int kUsageError = 2;  // exit status of every mistake on the command line

// The nearest of the words by letters that are missing, too many, wrong or swapped; empty: none is near.
std::string nearest(std::string_view misspelt, const std::vector<std::string>& words);

// The command that was chosen last: where the mistake is, if there is one.
const CLI::App& chosen_command(const CLI::App& app);

// One line on what was wrong with the command line, with a suggestion, and where the help is. Control characters are
// shown as \xNN.
std::string complaint(const CLI::App& app, const CLI::Error& error);

// Prints help, version or complaint, and returns the exit status: 0 or kUsageError.
int answer(const CLI::App& app, const CLI::ParseError& error);

}  // namespace base::command_line
