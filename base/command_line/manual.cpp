// Uses only the macros of man(7) that every formatter knows: TH, SH, SS, TP, PP, EX and EE, B and I by font escapes.
#include "base/command_line/manual.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdio>
#include <stdexcept>

#include "base/command_line/outline.hpp"
#include "base/command_line/suggestion.hpp"

namespace base::command_line {
namespace {

// The code point that begins at text[i], which moves behind it.
std::uint32_t code_point(const std::string& text, std::size_t& i) {
  const auto first = static_cast<unsigned char>(text[i++]);
  std::size_t more = first >= 0xF0 ? 3 : first >= 0xE0 ? 2 : first >= 0xC0 ? 1 : 0;
  std::uint32_t point = more == 0 ? first : first & (0x3FU >> more);
  for (; more > 0 && i < text.size(); --more) point = point << 6 | (static_cast<unsigned char>(text[i++]) & 0x3FU);
  return point;
}

// As roff reads it: a hyphen that can be copied, no escapes, no request at the beginning of the line.
std::string roff(const std::string& text) {
  std::string out = !text.empty() && (text.front() == '.' || text.front() == '\'') ? "\\&" : "";
  for (std::size_t i = 0; i < text.size();) {
    const std::uint32_t point = code_point(text, i);
    if (point == '\\') {
      out += "\\e";
    } else if (point == '-') {
      out += "\\-";
    } else if (point == '\'') {
      out += "\\(aq";
    } else if (point == '`') {
      out += "\\(ga";
    } else if (point == '^') {
      out += "\\(ha";
    } else if (point == '~') {
      out += "\\(ti";
    } else if (point < 0x80) {
      out += static_cast<char>(point);
    } else {
      std::array<char, 16> escape{};
      std::snprintf(escape.data(), escape.size(), "\\[u%04X]", static_cast<unsigned>(point));
      out += escape.data();
    }
  }
  return out;
}

std::string bold(const std::string& text) { return "\\fB" + roff(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + roff(text) + "\\fR"; }

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string page_name(const CLI::App& app, const CLI::App& command) {
  return &app == &command ? app.get_name() : app.get_name() + "-" + command.get_name();
}

std::string synopsis(const CLI::App& command) {
  std::string text = bold(full_name(command));
  if (!commands_of(command).empty()) text += " " + italic("COMMAND");
  text += " [" + italic("OPTIONS") + "]";
  for (const CLI::Option* argument : arguments_of(command)) {
    const std::string name = italic(argument->get_name(true)) + (argument->get_expected_max() > 1 ? "..." : "");
    text += argument->get_required() ? " " + name : " [" + name + "]";
  }
  return text + "\n";
}

void add_entry(std::string& page, const std::string& term, const std::string& meaning) {
  page += ".TP\n" + term + "\n" + (meaning.empty() ? "\\&" : roff(meaning)) + "\n";
}

void add_arguments_and_options(std::string& page, const CLI::App& command) {
  for (const CLI::Option* argument : arguments_of(command)) {
    const auto words = words_of(*argument);
    add_entry(page, italic(argument->get_name(true)) + (words.empty() ? "" : " " + roff(value_of(*argument))),
              meaning_of(*argument));
  }
  for (const CLI::Option* option : options_of(command)) {
    std::string term;
    for (const std::string& name : names_of(*option)) term += (term.empty() ? "" : ", ") + bold(name);
    const std::string value = value_of(*option);
    add_entry(page, value.empty() ? term : term + " " + italic(value), meaning_of(*option));
  }
}

void add_remarks(std::string& page, const CLI::App& command) {
  const std::string remarks = footer_of(command).remarks;
  if (!remarks.empty()) page += ".PP\n" + roff(remarks) + "\n";
}

void add_examples(std::string& page, const CLI::App& command) {
  const Footer footer = footer_of(command);
  for (const std::string& line : footer.examples) page += ".PP\n.EX\n" + roff(line) + "\n.EE\n";
  if (footer.block.empty()) return;
  page += ".PP\n.EX\n";
  for (const std::string& line : footer.block) page += roff(line) + "\n";
  page += ".EE\n";
}

// The commands by group; on the program's page only their names, elsewhere all that there is to say of each.
void add_commands(std::string& page, const CLI::App& app, Pages pages, const CLI::App& command) {
  std::string group;
  for (const CLI::App* one : commands_of(command)) {
    if (&app == &command && pages == Pages::of_each_command) {
      if (one->get_group() != group) page += ".SS " + roff(group = one->get_group()) + "\n";
      add_entry(page, bold(page_name(app, *one)) + "(1)", one->get_description());
      continue;
    }
    page += ".SS " + roff(full_name(*one)) + "\n" + roff(one->get_description()) + ".\n.PP\n" + synopsis(*one);
    add_arguments_and_options(page, *one);
    add_remarks(page, *one);
    add_examples(page, *one);
  }
}

const CLI::App& find_command(const CLI::App& app, const std::string& command) {
  if (command.empty() || command == app.get_name()) return app;
  std::vector<std::string> names;
  for (const CLI::App* one : commands_of(app)) {
    if (one->get_name() == command || page_name(app, *one) == command) return *one;
    names.push_back(one->get_name());
  }
  const std::string near = nearest(command, names);
  throw std::invalid_argument{"there is no manual page of '" + command + "'" +
                              (near.empty() ? "" : ", did you mean " + near + "?")};
}

}  // namespace

std::vector<std::string> manual_pages(const CLI::App& app) {
  std::vector<std::string> names{app.get_name()};
  for (const CLI::App* command : commands_of(app)) names.push_back(page_name(app, *command));
  return names;
}

std::string manual_page(const CLI::App& app, Pages pages, const std::string& command, const std::string& version,
                        const std::vector<ManualSection>& sections) {
  const CLI::App& of = find_command(app, command);
  const std::string name = page_name(app, of);
  std::string page = ".TH " + roff(upper(name)) + " 1 \"\" \"" + roff(app.get_name() + " " + version) + "\" \"\"\n";
  page += ".SH NAME\n" + roff(name) + " \\- " + roff(of.get_description()) + "\n.SH SYNOPSIS\n" + synopsis(of);
  if (!footer_of(of).remarks.empty()) page += ".SH DESCRIPTION\n";
  add_remarks(page, of);
  if (!options_of(of).empty() || !arguments_of(of).empty()) page += ".SH OPTIONS\n";
  add_arguments_and_options(page, of);
  if (!commands_of(of).empty()) page += ".SH COMMANDS\n";
  add_commands(page, app, pages, of);
  if (!footer_of(of).examples.empty() || !footer_of(of).block.empty()) page += ".SH EXAMPLES\n";
  add_examples(page, of);
  for (const ManualSection& section : sections) {
    page += ".SH " + roff(section.heading) + "\n";
    for (const auto& [term, meaning] : section.entries) add_entry(page, bold(term), meaning);
  }
  if (&of != &app) page += ".SH SEE ALSO\n" + bold(app.get_name()) + "(1)\n";
  return page;
}

}  // namespace base::command_line
