// Replaces CLI11's own formatter, whose lines are as long as the descriptions.
#include "base/command_line/help.hpp"

#include <algorithm>
#include <sstream>

#include "base/command_line/outline.hpp"

namespace base::command_line {
namespace {

constexpr std::size_t kColumns = 80;
constexpr std::size_t kIndent = 2;
constexpr std::size_t kGap = 2;
constexpr std::size_t kWidestName = 24;

std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

struct Line {
  std::string name;
  std::string meaning;
};

// The first line begins where `out` stands, at this column; so do the others.
void write_wrapped(std::ostream& out, const std::string& text, std::size_t column) {
  std::istringstream words{text};
  std::size_t at = column;
  for (std::string word; words >> word; at += width_of(word)) {
    if (at > column && at + 1 + width_of(word) > kColumns) {
      out << '\n' << std::string(column, ' ');
      at = column;
    } else if (at > column) {
      out << ' ';
      ++at;
    }
    out << word;
  }
  out << '\n';
}

// Names to the left, what they mean to the right, wrapped.
void write_lines(std::ostream& out, const std::vector<Line>& lines) {
  std::size_t widest = 0;
  for (const Line& line : lines) widest = std::max(widest, std::min(width_of(line.name), kWidestName));
  const std::size_t column = kIndent + widest + kGap;
  for (const Line& line : lines) {
    out << std::string(kIndent, ' ') << line.name;
    const std::size_t at = kIndent + width_of(line.name);
    if (at + kGap > column) {
      out << '\n' << std::string(column, ' ');
    } else {
      out << std::string(column - at, ' ');
    }
    write_wrapped(out, line.meaning, column);
  }
}

std::string argument_name(const CLI::Option& argument) {
  std::string name = argument.get_name(true) + (argument.get_expected_max() > 1 ? "..." : "");
  return argument.get_required() ? name : "[" + name + "]";
}

std::string option_name(const CLI::Option& option) {
  std::string text;
  for (const std::string& name : names_of(option)) text += (text.empty() ? "" : ", ") + name;
  const std::string value = value_of(option);
  return value.empty() ? text : text + " " + value;
}

class Help final : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string /*name*/, CLI::AppFormatMode /*mode*/) const override {
    std::ostringstream out;
    write_wrapped(out, app->get_description(), 0);
    out << '\n' << usage(*app);
    write_arguments(out, *app);
    for (const std::string& group : app->get_groups()) write_options(out, *app, group);
    write_commands(out, *app);
    const Footer footer = footer_of(*app);
    if (!app->get_footer().empty()) out << '\n';
    if (!footer.remarks.empty()) write_wrapped(out, footer.remarks, 0);
    if (!footer.block.empty()) out << "\nExamples:\n";
    for (const std::string& line : footer.block) out << "  " << line << '\n';
    for (const std::string& example : footer.examples) out << "Example: " << example << '\n';
    return out.str();
  }

 private:
  static std::string usage(const CLI::App& app) {
    std::string text = "Usage: " + full_name(app);
    const bool may_do_without = app.get_require_subcommand_min() == 0;
    if (!commands_of(app).empty()) text += may_do_without ? " [COMMAND]" : " COMMAND";
    text += " [OPTIONS]";
    for (const CLI::Option* argument : arguments_of(app)) text += " " + argument_name(*argument);
    return text + "\n";
  }

  static void write_arguments(std::ostream& out, const CLI::App& app) {
    std::vector<Line> lines;
    for (const CLI::Option* argument : arguments_of(app)) {
      const auto words = words_of(*argument);
      lines.push_back({argument->get_name(true), meaning_of(*argument)});
      if (!words.empty()) lines.back().name = value_of(*argument);
    }
    if (lines.empty()) return;
    out << "\nArguments:\n";
    write_lines(out, lines);
  }

  static void write_options(std::ostream& out, const CLI::App& app, const std::string& group) {
    std::vector<Line> lines;
    for (const CLI::Option* option : options_of(app)) {
      if (option->get_group() == group) lines.push_back({option_name(*option), meaning_of(*option)});
    }
    if (lines.empty()) return;
    out << '\n' << group << ":\n";
    write_lines(out, lines);
  }

  static void write_commands(std::ostream& out, const CLI::App& app) {
    std::vector<std::string> groups;
    for (const CLI::App* command : commands_of(app)) {
      if (std::ranges::find(groups, command->get_group()) == groups.end()) groups.push_back(command->get_group());
    }
    for (const std::string& group : groups) {
      std::vector<Line> lines;
      for (const CLI::App* command : commands_of(app)) {
        if (command->get_group() == group) lines.push_back({command->get_name(), command->get_description()});
      }
      out << '\n' << (group == "Subcommands" ? "Commands" : group) << ":\n";
      write_lines(out, lines);
    }
  }
};

}  // namespace

std::shared_ptr<CLI::FormatterBase> help_formatter() { return std::make_shared<Help>(); }

}  // namespace base::command_line
