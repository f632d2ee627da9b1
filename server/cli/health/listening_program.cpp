// The port's socket by its inode, then the process that has it open.
#include "server/cli/health/listening_program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace server::cli {
namespace fs = std::filesystem;
namespace asio = boost::asio;

namespace {

// "0100007F": 32 bits at a time, each as this machine reads them.
asio::ip::address address_of(const std::string& digits) {
  std::array<unsigned char, 16> bytes{};
  for (std::size_t at = 0; 8 * (at + 1) <= digits.size() && at < 4; ++at) {
    const auto word = static_cast<std::uint32_t>(std::stoul(digits.substr(8 * at, 8), nullptr, 16));
    std::memcpy(&bytes[4 * at], &word, sizeof word);
  }
  if (digits.size() == 8) return asio::ip::address_v4{{bytes[0], bytes[1], bytes[2], bytes[3]}};
  const asio::ip::address_v6 address{bytes};
  if (address.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, address);
  return address;
}

bool overlap(const asio::ip::address& one, const asio::ip::address& other) {
  return one == other || one.is_unspecified() || other.is_unspecified();
}

// Lines of /proc/net/tcp: "0: 0100007F:1F90 00000000:0000 0A … inode": local address in hexadecimal, state 0A listens.
std::string inode_of_listener(const char* table, const asio::ip::tcp::endpoint& endpoint) {
  std::ifstream in{table};
  const std::string wanted = fmt::format(":{:04X}", endpoint.port());
  for (std::string line; std::getline(in, line);) {
    std::istringstream words{line};
    std::string number, local, remote, state, queues, timer, retransmits, uid, timeout, inode;
    words >> number >> local >> remote >> state >> queues >> timer >> retransmits >> uid >> timeout >> inode;
    if (!local.ends_with(wanted) || state != "0A") continue;
    if (overlap(address_of(local.substr(0, local.find(':'))), endpoint.address())) return inode;
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

std::optional<ListeningProgram> find_listening_program(const asio::ip::tcp::endpoint& endpoint) {
  std::string inode = inode_of_listener("/proc/net/tcp", endpoint);
  if (inode.empty()) inode = inode_of_listener("/proc/net/tcp6", endpoint);
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
