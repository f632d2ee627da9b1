// The port's socket by its inode, then the process that has it open.
#include "server/cli/health/listening_program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace server::cli {
namespace fs = std::filesystem;

namespace {

// Lines of /proc/net/tcp: "0: 0100007F:1F90 00000000:0000 0A … inode": local address in hexadecimal, state 0A listens.
std::string inode_of_listener(const char* table, int port) {
  std::ifstream in{table};
  const std::string wanted = fmt::format(":{:04X}", port);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words{line};
    std::string number, local, remote, state, queues, timer, retransmits, uid, timeout, inode;
    words >> number >> local >> remote >> state >> queues >> timer >> retransmits >> uid >> timeout >> inode;
    if (local.ends_with(wanted) && state == "0A") return inode;
  }
  return "";
}

bool has_open(const fs::path& process, const std::string& socket) {
  std::error_code error;
  for (fs::directory_iterator at{process / "fd", error}, end; !error && at != end; at.increment(error)) {
    std::error_code gone;
    if (fs::read_symlink(at->path(), gone) == socket) return true;
  }
  return false;
}

}  // namespace

std::optional<ListeningProgram> find_listening_program(int port) {
  std::string inode = inode_of_listener("/proc/net/tcp", port);
  if (inode.empty()) inode = inode_of_listener("/proc/net/tcp6", port);
  if (inode.empty()) return std::nullopt;
  std::error_code error;
  for (fs::directory_iterator at{"/proc", error}, end; !error && at != end; at.increment(error)) {
    const std::string pid = at->path().filename();
    if (!std::ranges::all_of(pid, [](unsigned char c) { return std::isdigit(c) != 0; })) continue;
    if (!has_open(at->path(), fmt::format("socket:[{}]", inode))) continue;
    std::string name;
    std::ifstream comm{at->path() / "comm"};
    std::getline(comm, name);
    return ListeningProgram{std::stoi(pid), name};
  }
  return ListeningProgram{};
}

}  // namespace server::cli
