// Distance by Damerau and Levenshtein, with one swap of neighbours at a time.
#include "base/command_line/suggestion.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>

#include "base/command_line/outline.hpp"

namespace base::command_line {
namespace {

constexpr const char* kDidYouMean = ", did you mean ";
constexpr std::size_t kLongBeginning = 6;  // letters that may be the beginning of a word

// From a to each beginning of b, from the empty one to b itself.
std::vector<std::size_t> distances(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before = std::exchange(last, row);
  }
  return last;
}

std::string printable(std::string_view text) {
  std::string shown;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    std::array<char, 5> escaped{};
    std::snprintf(escaped.data(), escaped.size(), "\\x%02X", byte);
    shown += byte < 0x20 || byte == 0x7F ? std::string{escaped.data()} : std::string{c};
  }
  return shown;
}

std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options_of(command)) {
    for (std::string& name : names_of(*option)) names.push_back(std::move(name));
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* one : commands_of(command)) names.push_back(one->get_name());
  return names;
}

std::string with_suggestion(const std::string& what, std::string_view misspelt, const std::vector<std::string>& words) {
  const std::string found = nearest(misspelt, words);
  return found.empty() ? what : what + kDidYouMean + found;
}

// Of a value that is none of some words. CLI11 says "--fluid: watr not in {water,oil}" where a validator of ours says
// "--fluid must be one of water, oil, is 'watr'".
std::string about_value(std::string what) {
  constexpr std::string_view kNotIn = " not in {", kMust = " must be one of ", kIs = ", is '";
  if (const std::size_t braces = what.find(kNotIn); braces != std::string::npos && what.ends_with('}')) {
    const std::size_t colon = what.rfind(": ", braces);
    if (colon == std::string::npos) return what;
    std::string words = what.substr(braces + kNotIn.size(), what.size() - braces - kNotIn.size() - 1);
    for (std::size_t comma = 0; (comma = words.find(',', comma)) != std::string::npos; comma += 2)
      words.insert(comma + 1, " ");
    const std::string value = what.substr(colon + 2, braces - colon - 2);
    what = what.substr(0, colon) + std::string{kMust} + words + std::string{kIs} + value + "'";
  }
  const std::size_t must = what.find(kMust), is = what.rfind(kIs);
  if (must == std::string::npos || is == std::string::npos || is < must || !what.ends_with('\'')) return what;
  std::vector<std::string> words{""};
  for (const char c : what.substr(must + kMust.size(), is - must - kMust.size())) {
    if (c == ',') words.emplace_back();
    if (c != ',' && c != ' ') words.back() += c;
  }
  return with_suggestion(what, what.substr(is + kIs.size(), what.size() - is - kIs.size() - 1), words);
}

// Of a word that no command or option takes.
std::string about_unknown(const CLI::App& at, const std::string& word, const CLI::Error& error) {
  const std::string name = word.substr(0, word.find('='));
  if (name.starts_with("-")) {
    return with_suggestion("there is no option " + name + " of '" + full_name(at) + "'", name, option_names(at));
  }
  if (const auto names = command_names(at); !names.empty()) {
    return with_suggestion(
        "there is no command '" + (at.get_parent() != nullptr ? at.get_name() + " " : "") + word + "'", word, names);
  }
  return error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError)
             ? "'" + word + "' is one word too many for '" + full_name(at) + "'"
             : std::string{error.what()};
}

}  // namespace

std::string nearest(std::string_view misspelt, const std::vector<std::string>& words) {
  const std::size_t letters = misspelt.size() - std::min(misspelt.find_first_not_of('-'), misspelt.size());
  std::size_t best = 1 + letters / 3;  // farther is another word
  std::string found;
  for (const std::string& word : words) {
    const auto found_at = distances(misspelt, word);
    std::size_t here = found_at.back();
    // "--phase-margn" is a letter away from the beginning of "--phase-margin-deg", which is farther than a whole word.
    if (letters >= kLongBeginning) here = std::min(here, 1 + *std::ranges::min_element(found_at));
    if (here < best || (here == best && found.empty() && letters > 1)) {
      best = here;
      found = word;
    }
  }
  return found;
}

const CLI::App& chosen_command(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app : chosen_command(*chosen.front());
}

std::string complaint(const CLI::App& app, const CLI::Error& error) {
  const CLI::App& at = chosen_command(app);
  const auto unknown = app.remaining(true);
  std::string what = error.what();
  if (!unknown.empty()) what = about_unknown(at, unknown.front(), error);
  if (unknown.empty() && error.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError) &&
      at.get_require_subcommand_min() > 0) {
    what = "'" + full_name(at) + "' needs a command";
  }
  // CLI11 puts "--name: " before what a validator says.
  if (const std::size_t colon = what.find(": must "); what.starts_with("--") && colon != std::string::npos) {
    what.erase(colon, 1);
  }
  what = about_value(std::move(what));
  const bool is_question = what.find(kDidYouMean) != std::string::npos;
  return app.get_name() + ": " + printable(what) + (is_question ? "? See " : "; see ") + full_name(at) + " --help\n";
}

int answer(const CLI::App& app, const CLI::ParseError& error) {
  if (app.exit(error) == 0) return 0;
  return kUsageError;
}

}  // namespace base::command_line
