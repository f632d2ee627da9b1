// `rheonaut token`: API tokens for scripts, each with the scopes it needs; with a running station and without one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>

namespace CLI {
class App;
}

namespace server::cli {

struct TokenCommand {
  enum class Act : std::uint8_t { create, list, revoke, revive };
  Act act = Act::list;
  std::filesystem::path data_dir = "rheonaut-data";
  std::string name;
  std::string scopes = "read,stop";
  std::int64_t days = 0;  // 0: it does not run out
  bool json = false;
};

void add_options(CLI::App& command, TokenCommand& options);

// `create` prints the token; nobody can read it again. Throws std::runtime_error saying why nothing was changed.
int run(const TokenCommand& options, std::ostream& out);

}  // namespace server::cli
