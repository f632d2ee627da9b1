// Reads App and Option of CLI11 2.1.
#include "base/command_line/outline.hpp"

#include <algorithm>
#include <sstream>

namespace base::command_line {
namespace {

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

std::vector<std::string> names_of_all(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options) {
    const auto own = names_of(*option);
    names.push_back(own.empty() ? option->get_name() : own.front());
  }
  std::ranges::sort(names);  // the set is ordered by address
  return names;
}

}  // namespace

std::string full_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return parent == nullptr ? command.get_name() : full_name(*parent) + " " + command.get_name();
}

std::vector<const CLI::App*> commands_of(const CLI::App& command) {
  return command.get_subcommands(
      [](const CLI::App* one) { return !one->get_name().empty() && !one->get_group().empty(); });
}

std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* one) { return one->nonpositional() && !one->get_group().empty(); });
}

std::vector<const CLI::Option*> arguments_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* one) { return one->get_positional() && !one->get_group().empty(); });
}

std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

bool takes_value(const CLI::Option& option) { return option.get_type_size() != 0 && option.get_expected_max() != 0; }

std::vector<std::string> words_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t begin = type.find('{'), end = type.rfind('}');
  if (begin == std::string::npos || end == std::string::npos || !takes_value(option)) return {};
  std::vector<std::string> words;
  std::istringstream list{type.substr(begin + 1, end - begin - 1)};
  for (std::string word; std::getline(list, word, ',');) words.push_back(word);
  return words;
}

std::string value_of(const CLI::Option& option) {
  if (!takes_value(option)) return "";
  if (const auto words = words_of(option); !words.empty()) return joined(words, "|");
  const std::string type = option.get_type_name().substr(0, option.get_type_name().find(':'));
  if (type.starts_with("INT") || type.starts_with("UINT")) return "N";
  if (type.starts_with("FLOAT")) return "X";
  return type.empty() ? "TEXT" : type;
}

std::string conditions_of(const CLI::Option& option) {
  std::vector<std::string> conditions;
  if (option.get_required() && !option.get_positional()) conditions.emplace_back("required");
  if (option.get_expected_max() > 1 && takes_value(option)) conditions.emplace_back("may be repeated");
  if (!option.get_needs().empty()) conditions.push_back("only with " + joined(names_of_all(option.get_needs()), ", "));
  if (!option.get_excludes().empty()) {
    conditions.push_back("not with " + joined(names_of_all(option.get_excludes()), ", "));
  }
  return joined(conditions, "; ");
}

std::string meaning_of(const CLI::Option& option) {
  const std::string conditions = conditions_of(option);
  const std::string described = option.get_description(), preset = option.get_default_str();
  const bool is_said = preset.empty() || described.find("default") != std::string::npos;
  return described + (is_said ? "" : " (default: " + preset + ")") +
         (conditions.empty() ? "" : " (" + conditions + ")");
}

Footer footer_of(const CLI::App& command) {
  Footer footer;
  std::istringstream lines{command.get_footer()};
  constexpr std::string_view kExample = "Example: ";
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(kExample)) {
      footer.examples.push_back(line.substr(kExample.size()));
    } else if (line.starts_with("  ")) {
      footer.block.push_back(line.substr(2));
    } else if (line != "Examples:") {
      footer.remarks += (footer.remarks.empty() ? "" : " ") + line;
    }
  }
  return footer;
}

}  // namespace base::command_line
