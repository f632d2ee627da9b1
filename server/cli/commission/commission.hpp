// `rheonaut robot commission`: the first hour with a robot, step by step, and a record of what was found.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct Commission {
  std::filesystem::path data_dir = "rheonaut-data";
  std::string robot_id;
  std::filesystem::path into = ".";
  std::optional<std::filesystem::path> answers;
  std::optional<std::string> signed_by;
  double largest_duty = 0.3;
  bool says_yes = false;
  OutputForm form;
};

void add_options(CLI::App& command, Commission& options);

// Talks with the person on standard error and the terminal; prints what was found. 0 when the record is signed, else
// kNotSigned. Throws UsageError, or std::runtime_error saying why it did not begin.
inline constexpr int kNotSigned = 5;
int run(const Commission& options, std::ostream& out);

}  // namespace server::cli
