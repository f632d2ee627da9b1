// The vocabulary of the command-line tests: a command as a person types it, its exit status and what it printed.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "server/cli/command_line.hpp"

namespace server::cli {

class ToolTest : public ::testing::Test {
 protected:
  ToolTest() {
    std::string name = (std::filesystem::temp_directory_path() / "rheonaut_cli_XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~ToolTest() override { std::filesystem::remove_all(folder_); }

  // Words are separated by spaces; "@name" is a file of the test's folder.
  struct Answer {
    int exit_code = 0;
    std::string text;   // standard output
    std::string error;  // what the user is told when it fails
    nlohmann::json json() const { return nlohmann::json::parse(text); }
  };

  Answer ask(const std::string& command) {
    std::vector<std::string> words{"rheonaut"};
    std::istringstream stream{command};
    for (std::string word; stream >> word;) {
      words.push_back(word.starts_with('@') ? (folder_ / word.substr(1)).string() : word);
    }
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    Answer given;
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    const Wish wish = parse_command_line(static_cast<int>(arguments.size()), arguments.data());
    const std::string help = ::testing::internal::GetCapturedStdout();
    given.error = ::testing::internal::GetCapturedStderr();
    std::ostringstream out;
    try {
      given.exit_code = answer(wish, out).value_or(0);
    } catch (const std::exception& error) {  // as main does
      given.exit_code = 1;
      given.error += error.what();
    }
    given.text = help + out.str();
    return given;
  }

  void save(const std::string& name, const std::string& text) { std::ofstream{folder_ / name} << text; }

  std::filesystem::path folder_;
};

}  // namespace server::cli
