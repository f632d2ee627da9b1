// Options whose values are checked before the tool sees them: numbers with limits, names, words of an enumeration.
//
// A value that is refused ends the parsing with one sentence: "--points must be a whole number from 2 to 100000, is 1".
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "server/analysis/control_json.hpp"

namespace server::cli {

using analysis::text;  // beside those of the tools' own enumerations

// Each is a validator for CLI::Option::check.
CLI::Validator finite();
CLI::Validator positive();      // and finite
CLI::Validator non_negative();  // and finite
CLI::Validator from_to(double low, double high);
CLI::Validator whole(long long low, long long high);
CLI::Validator named();  // any text but the empty one, which an unset variable of the shell leaves

// For commands whose answer a station may compute for minutes.
inline constexpr double kLongAnswer_s = 600;
void add_timeout_option(CLI::App& command, double& timeout_s);

// One of `values`, by the word that text() gives it.
template <class T, class Target, std::size_t count>
CLI::Option* add_word(CLI::App& command, const char* name, Target& target, std::array<T, count> values,
                      const char* help) {
  const auto find = [values](const std::string& word) {
    return std::ranges::find_if(values, [&word](T value) { return word == text(value); }) - values.begin();
  };
  const auto refuse = [values, find](std::string& word) -> std::string {
    if (find(word) < static_cast<std::ptrdiff_t>(count)) return {};
    std::vector<std::string> words;
    words.reserve(values.size());
    for (const T value : values) words.emplace_back(text(value));
    return fmt::format("must be one of {}, is '{}'", fmt::join(words, ", "), word);
  };
  auto* option = command.add_option_function<std::string>(
      name,
      [&target, values, find](const std::string& word) { target = values.at(static_cast<std::size_t>(find(word))); },
      help);
  std::vector<std::string> words;
  for (const T value : values) words.emplace_back(text(value));
  option->check(CLI::Validator{refuse, fmt::format("{{{}}}", fmt::join(words, ","))});  // as CLI::IsMember describes it
  return option;
}

}  // namespace server::cli
