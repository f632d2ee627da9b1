// Which program listens on a TCP port of this machine, as /proc tells.
#pragma once

#include <optional>
#include <string>

namespace server::cli {

struct ListeningProgram {
  int pid = 0;  // 0: another user's, which only root may see
  std::string name;
};

// None: nobody listens there, on any address.
std::optional<ListeningProgram> find_listening_program(int port);

}  // namespace server::cli
