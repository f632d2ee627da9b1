// `--help` of both programs and of every command that they list.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <sstream>
#include <string_view>
#include <vector>

#include "tests/goldens/golden_file.hpp"

namespace server {
namespace {

std::string printed_by(const std::string& command) {
  FILE* const pipe = ::popen(fmt::format("PATH='{}':$PATH {} 2>&1", PROGRAMS_DIR, command).c_str(), "r");
  if (pipe == nullptr) return "cannot run";
  std::string text;
  std::array<char, 4096> bytes;
  for (std::size_t size = 1; size > 0;) {
    size = std::fread(bytes.data(), 1, bytes.size(), pipe);
    text.append(bytes.data(), size);
  }
  EXPECT_EQ(::pclose(pipe), 0) << command;
  return text;
}

// The first words under each heading of commands.
std::vector<std::string> commands_in(const std::string& help) {
  std::vector<std::string> commands;
  if (!help.contains("COMMAND")) return commands;  // in the line of usage
  constexpr std::array<std::string_view, 4> kOtherHeadings{"Options:", "Arguments:", "Example:", "Examples:"};
  bool is_of_commands = false;
  std::istringstream lines{help};
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(' ')) {
      is_of_commands = line.ends_with(':') && std::ranges::find(kOtherHeadings, line) == kOtherHeadings.end();
    } else if (is_of_commands && line.starts_with("  ") && line[2] != ' ') {
      commands.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
  }
  return commands;
}

std::string help_of(const std::string& command) {
  const std::string help = printed_by(command + " --help");
  std::string text = fmt::format("$ {} --help\n{}\n", command, help);
  for (const std::string& each : commands_in(help)) text += help_of(command + " " + each);
  return text;
}

TEST(GoldenHelp, OfTheStationsProgram) { expect_golden("help/rheonaut.txt", help_of("rheonaut")); }
TEST(GoldenHelp, OfTheSimulatedRobots) { expect_golden("help/rheonaut-sim.txt", help_of("rheonaut-sim")); }

}  // namespace
}  // namespace server
