// `rheonaut completion` and `rheonaut man`: made from the definition of the command line at the moment they are asked
// for, so that they never differ from it.
#pragma once

#include <iosfwd>
#include <string>

namespace CLI {
class App;
}

namespace server::cli {

struct CompletionCommand {
  std::string shell;
};

struct ManualCommand {
  std::string command;  // empty: the program
  bool is_list = false;
};

void add_options(CLI::App& command, CompletionCommand& options);
void add_options(CLI::App& command, ManualCommand& options);

// Of the program `app`: the script, the page, or the names of all pages. Throws UsageError naming a command that has no
// page.
void write(const CompletionCommand& options, const CLI::App& app, std::ostream& out);
void write(const ManualCommand& options, const CLI::App& app, std::ostream& out);

}  // namespace server::cli
