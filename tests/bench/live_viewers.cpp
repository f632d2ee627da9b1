// Many pages that look at robots: WebSockets on /live, each watching one robot, read and thrown away.
//
//   live_viewers PORT TOKEN COUNT ROBOTS FIRST
//
// Viewer i, of FIRST, FIRST + 1 and so on, watches robot sim-((i mod ROBOTS) + 1). Says "ready" when all are connected;
// ends with its standard input, and prints how many bytes came. Exit status 1 when a viewer is refused or loses its
// connection.
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "loopback.hpp"

using bare::connect_to;
using bare::send_all;

namespace {

// A short text frame, as a client masks it: with zeros.
std::string text_frame(const std::string& text) {
  return std::string{'\x81', static_cast<char>(0x80U | text.size())} + std::string(4, '\0') + text;
}

int open_viewer(std::uint16_t port, const std::string& token, const std::string& robot) {
  const int fd = connect_to(port);
  send_all(fd,
           "GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
           "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nAuthorization: Bearer " +
               token + "\r\n\r\n");
  std::string answer;
  while (answer.find("\r\n\r\n") == std::string::npos) {
    char byte = 0;
    if (recv(fd, &byte, 1, 0) != 1) throw std::runtime_error{"no answer"};
    answer += byte;
  }
  if (!answer.starts_with("HTTP/1.1 101")) throw std::runtime_error{answer};
  send_all(fd, text_frame(R"({"type":"watch","robots":[")" + robot + "\"]}"));
  return fd;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 6) throw std::runtime_error{"live_viewers PORT TOKEN COUNT ROBOTS FIRST"};
  const auto port = static_cast<std::uint16_t>(std::stoi(argv[1]));
  const int count = std::stoi(argv[3]), robots = std::stoi(argv[4]), first = std::stoi(argv[5]);
  std::vector<pollfd> waited{{STDIN_FILENO, POLLIN, 0}};
  for (int i = 0; i < count; ++i) {
    const std::string robot = "sim-" + std::to_string((first + i) % robots + 1);
    waited.push_back({open_viewer(port, argv[2], robot), POLLIN, 0});
  }
  std::cout << "ready" << std::endl;
  std::uint64_t bytes = 0;
  std::array<char, 65536> buffer;
  auto said_at = std::chrono::steady_clock::now();
  while (poll(waited.data(), waited.size(), 1000) >= 0 && waited[0].revents == 0) {
    const auto now = std::chrono::steady_clock::now();
    if (now - said_at > std::chrono::seconds{5}) {  // or the station would take them for dead
      said_at = now;
      for (const pollfd& viewer : waited) {
        if (viewer.fd != STDIN_FILENO) send_all(viewer.fd, text_frame(R"({"type":"keep_alive"})"));
      }
    }
    for (const pollfd& viewer : waited) {
      if (viewer.revents == 0 || viewer.fd == STDIN_FILENO) continue;
      const ssize_t got = recv(viewer.fd, buffer.data(), buffer.size(), 0);
      if (got <= 0) throw std::runtime_error{"a viewer lost its connection"};
      bytes += static_cast<std::uint64_t>(got);
    }
    usleep(5000);  // as a browser looks now and then
  }
  std::cout << bytes << std::endl;
  return 0;
} catch (const std::exception& error) {
  std::cerr << "live_viewers: " << error.what() << '\n';
  return 1;
}
