// Which program listens on an address of this machine, as /proc tells.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <optional>
#include <string>

namespace server::cli {

struct ListeningProgram {
  int pid = 0;  // 0: another user's, which only root may see
  std::string name;
};

// Who keeps others from listening there: on this address, or on every address; for the unspecified address, on any.
// None: nobody.
std::optional<ListeningProgram> find_listening_program(const boost::asio::ip::tcp::endpoint& endpoint);

}  // namespace server::cli
