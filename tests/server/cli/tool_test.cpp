// Stands for main: parses the words, runs the tool, and catches what it throws.
#include "tests/server/cli/tool_test.hpp"

#include <algorithm>
#include <sstream>

namespace server::cli {

ToolAnswer ask_tool(const std::filesystem::path& folder, const std::string& command) {
  std::vector<std::string> words{"rheonaut"};
  std::istringstream stream{command};
  for (std::string word; stream >> word;) {
    words.push_back(word == "@@" ? "" : word.starts_with('@') ? (folder / word.substr(1)).string() : word);
  }
  const auto has = [&words](const char* word) { return std::ranges::find(words, word) != words.end(); };
  if (has("identify") && (has("--csv") || has("--run")) && !has("--time-limit-s")) {
    words.insert(words.end(), {"--time-limit-s", "1000000"});  // a busy machine ends no search
  }
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  ToolAnswer given;
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  const cli::CommandLine line = parse_command_line(static_cast<int>(arguments.size()), arguments.data());
  const std::string help = ::testing::internal::GetCapturedStdout();
  given.error = ::testing::internal::GetCapturedStderr();
  std::ostringstream out;
  ::testing::internal::CaptureStderr();
  std::string thrown;
  try {
    given.exit_code = answer(line, out).value_or(0);
  } catch (const std::exception& error) {
    given.exit_code = 1;
    thrown = error.what();
  }
  given.error += ::testing::internal::GetCapturedStderr() + thrown;
  given.text = help + out.str();
  return given;
}

}  // namespace server::cli
