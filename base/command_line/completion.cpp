// Each script first finds the command that the words so far have chosen, then offers what the definition says of it.
#include "base/command_line/completion.hpp"

#include <algorithm>
#include <functional>
#include <stdexcept>

#include "base/command_line/outline.hpp"

namespace base::command_line {
namespace {

// "" for the program, " robot list" for a command: what the scripts call `at`.
std::string place_of(const CLI::App& command) {
  return command.get_parent() == nullptr ? "" : place_of(*command.get_parent()) + " " + command.get_name();
}

std::vector<const CLI::App*> all_commands(const CLI::App& app) {
  std::vector<const CLI::App*> all{&app};
  for (const CLI::App* command : commands_of(app)) {
    for (const CLI::App* one : all_commands(*command)) all.push_back(one);
  }
  return all;
}

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size()) {
    text.replace(at, what.size(), by);
  }
  return text;
}

// In single quotes, for bash and zsh; for fish.
std::string quoted(const std::string& text) { return "'" + replaced(text, "'", "'\\''") + "'"; }
std::string fish_quoted(const std::string& text) {
  return "'" + replaced(replaced(text, "\\", "\\\\"), "'", "\\'") + "'";
}

// " serve"|" robot"|" robot list", or with other quotes.
std::string every_place(const CLI::App& app, const std::string& between) {
  std::vector<std::string> places;
  for (const CLI::App* command : all_commands(app)) {
    if (command != &app) places.push_back(quoted(place_of(*command)));
  }
  return joined(places, between);
}

std::vector<std::string> option_words(const CLI::App& command) {
  std::vector<std::string> words;
  for (const CLI::Option* option : options_of(command)) {
    for (std::string& name : names_of(*option)) words.push_back(std::move(name));
  }
  return words;
}

std::vector<std::string> command_words(const CLI::App& command) {
  std::vector<std::string> words;
  for (const CLI::App* one : commands_of(command)) words.push_back(one->get_name());
  return words;
}

// Of the first argument that has some.
std::vector<std::string> argument_words(const CLI::App& command) {
  for (const CLI::Option* argument : arguments_of(command)) {
    if (auto words = words_of(*argument); !words.empty()) return words;
  }
  return {};
}

// Calls with the patterns `' export --format'|…` of an option and its words.
void each_value(const CLI::App& app,
                const std::function<void(const std::string&, const std::vector<std::string>&)>& f) {
  for (const CLI::App* command : all_commands(app)) {
    for (const CLI::Option* option : options_of(*command)) {
      if (!takes_value(*option)) continue;
      std::vector<std::string> patterns;
      for (const std::string& name : names_of(*option)) patterns.push_back(quoted(place_of(*command) + " " + name));
      f(joined(patterns, "|"), words_of(*option));
    }
  }
}

std::string bash(const CLI::App& app) {
  const std::string name = app.get_name(), function = "_" + replaced(name, "-", "_");
  std::string text = "# Completion of " + name + " for bash.\n" + function + R"(() {
  local cur=${COMP_WORDS[COMP_CWORD]} at= words= i
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$at ${COMP_WORDS[i]}" in
      )" + every_place(app, "|") +
                     R"() at="$at ${COMP_WORDS[i]}" ;;
    esac
  done
  case "$at ${COMP_WORDS[COMP_CWORD-1]}" in
)";
  each_value(app, [&text](const std::string& patterns, const std::vector<std::string>& words) {
    text += "    " + patterns + ") " +
            (words.empty() ? "return"
                           : "COMPREPLY=($(compgen -W " + quoted(joined(words, " ")) + " -- \"$cur\")); return") +
            " ;;\n";
  });
  text += "  esac\n  case \"$at\" in\n";
  for (const CLI::App* command : all_commands(app)) {
    auto others = command_words(*command);
    for (std::string& word : argument_words(*command)) others.push_back(std::move(word));
    text += "    " + quoted(place_of(*command)) +
            ") if [[ $cur == -* ]]; then words=" + quoted(joined(option_words(*command), " ")) +
            "; else words=" + quoted(joined(others, " ")) + "; fi ;;\n";
  }
  return text + "  esac\n  COMPREPLY=($(compgen -W \"$words\" -- \"$cur\"))\n}\ncomplete -o default -F " + function +
         " " + name + "\n";
}

std::string described(const std::string& word, const std::string& meaning) {
  return quoted(replaced(word, ":", "\\:") + ":" + meaning);
}

std::string zsh(const CLI::App& app) {
  const std::string name = app.get_name(), function = "_" + replaced(name, "-", "_");
  std::string text = "#compdef " + name + "\n# Completion of " + name + " for zsh.\n" + function + R"(() {
  local at= i
  local -a offered options
  for ((i = 2; i < CURRENT; i++)); do
    case "$at ${words[i]}" in
      )" + every_place(app, "|") +
                     R"() at="$at ${words[i]}" ;;
    esac
  done
  case "$at ${words[CURRENT-1]}" in
)";
  each_value(app, [&text](const std::string& patterns, const std::vector<std::string>& words) {
    text +=
        "    " + patterns + ") " + (words.empty() ? "_files" : "compadd -- " + joined(words, " ")) + "; return ;;\n";
  });
  text += "  esac\n  case \"$at\" in\n";
  for (const CLI::App* command : all_commands(app)) {
    std::vector<std::string> offered, options;
    for (const CLI::App* one : commands_of(*command))
      offered.push_back(described(one->get_name(), one->get_description()));
    for (const std::string& word : argument_words(*command)) offered.push_back(quoted(word));
    for (const CLI::Option* option : options_of(*command)) {
      for (const std::string& one : names_of(*option)) options.push_back(described(one, option->get_description()));
    }
    text += "    " + quoted(place_of(*command)) + ")\n      offered=(" + joined(offered, "\n        ") +
            ")\n      options=(" + joined(options, "\n        ") + ") ;;\n";
  }
  return text + R"(  esac
  if [[ ${words[CURRENT]} == -* ]]; then
    _describe -o option options
  elif ((${#offered})); then
    _describe command offered
  else
    _files
  fi
}
if [[ ${funcstack[1]} == )" +
         function + R"( ]]; then
  )" + function +
         R"( "$@"
else
  compdef )" +
         function + " " + name + "\nfi\n";
}

std::string fish(const CLI::App& app) {
  const std::string name = app.get_name(), function = "__" + replaced(name, "-", "_") + "_at";
  std::string text = "# Completion of " + name + " for fish.\nfunction " + function + R"(
    set -l at ''
    for word in (commandline -opc)[2..-1]
        switch "$at $word"
            case )" + every_place(app, " ") +
                     R"(
                set at "$at $word"
        end
    end
    test "$at" = "$argv[1]"
end
)";
  for (const CLI::App* command : all_commands(app)) {
    const std::string begin =
        "complete -c " + name + " -n " + fish_quoted(function + " " + fish_quoted(place_of(*command)));
    for (const CLI::App* one : commands_of(*command)) {
      text += begin + " -f -a " + one->get_name() + " -d " + fish_quoted(one->get_description()) + "\n";
    }
    if (const auto words = argument_words(*command); !words.empty()) {
      text += begin + " -f -a " + fish_quoted(joined(words, " ")) + "\n";
    }
    for (const CLI::Option* option : options_of(*command)) {
      std::string line = begin;
      for (const std::string& long_name : option->get_lnames()) line += " -l " + long_name;
      for (const std::string& short_name : option->get_snames()) line += " -s " + short_name;
      const auto words = words_of(*option);
      if (takes_value(*option)) line += words.empty() ? " -r" : " -x -a " + fish_quoted(joined(words, " "));
      text += line + " -d " + fish_quoted(option->get_description()) + "\n";
    }
  }
  return text;
}

}  // namespace

std::string completion_script(const CLI::App& app, const std::string& shell) {
  if (shell == "bash") return bash(app);
  if (shell == "zsh") return zsh(app);
  if (shell == "fish") return fish(app);
  throw std::invalid_argument{"there is no completion for '" + shell + "': bash, zsh or fish"};
}

}  // namespace base::command_line
