// The vocabulary of the command-line tests: a command as a person types it, its exit status and what it printed.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "server/cli/command_line.hpp"

namespace server::cli {

struct ToolAnswer {
  int exit_code = 0;
  std::string text;   // standard output
  std::string error;  // the message to the user when it fails
  nlohmann::json json() const { return nlohmann::json::parse(text); }
};

// Words of the command are separated by spaces; "@name" is a file of the folder, "@@" an empty word.
ToolAnswer ask_tool(const std::filesystem::path& folder, const std::string& command);

class ToolTest : public ::testing::Test {
 protected:
  using Answer = ToolAnswer;

  ToolTest() {
    std::string name = (std::filesystem::temp_directory_path() / "rheonaut-cli-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + name};
    folder_ = name;
  }
  ~ToolTest() override { std::filesystem::remove_all(folder_); }

  Answer ask(const std::string& command) { return ask_tool(folder_, command); }
  void save(const std::string& name, const std::string& text) { std::ofstream{folder_ / name} << text; }

  std::filesystem::path folder_;
};

}  // namespace server::cli
