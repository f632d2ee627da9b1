// Pages that open in front of a fleet, so many a second: each lists the robots and is welcomed on /live, then goes.
//
//   page_openers PORT TOKEN PAGES_A_SECOND ROBOTS
//
// Says "ready" when the first pages have opened; ends with its standard input, and prints how many opened, and the p50
// and worst time of one in ms. Exit status 1 when a page is refused, does not receive ROBOTS robots, or none opened.
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <iostream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "loopback.hpp"

using bare::connect_to;
using bare::send_all;
using Steady = std::chrono::steady_clock;

namespace {

class Connection {
 public:
  explicit Connection(std::uint16_t port) : fd_{connect_to(port)} {}
  ~Connection() { close(fd_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void send(const std::string& bytes) const { send_all(fd_, bytes); }
  // Whatever has come, at least a byte; empty at the end.
  std::string receive() {
    const ssize_t got = recv(fd_, buffer_.data(), buffer_.size(), 0);
    if (got < 0) throw std::runtime_error{"a page lost its connection"};
    return {buffer_.data(), static_cast<std::size_t>(got)};
  }

 private:
  int fd_;
  std::array<char, 65536> buffer_{};
};

std::string request_of(const std::string& path, const std::string& token, const std::string& fields) {
  return "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer " + token + "\r\n" + fields + "\r\n";
}

// How many robots a text contains; a name that is cut in two by a chunk or a frame is not counted.
int robots_in(const std::string& text) {
  int robots = 0;
  for (auto at = text.find("\"robot_id\""); at != std::string::npos; at = text.find("\"robot_id\"", at + 1)) ++robots;
  return robots;
}

void check(const std::string& what, const std::string& text, int robots) {
  const int found = robots_in(text);
  if (found < robots) {
    throw std::runtime_error{what + " tells of " + std::to_string(found) + " robots: " + text.substr(0, 200)};
  }
}

void list_robots(std::uint16_t port, const std::string& token, int robots) {
  Connection connection{port};
  connection.send(request_of("/api/v1/robots", token, "Connection: close\r\n"));
  std::string answer;
  for (std::string piece = connection.receive(); !piece.empty(); piece = connection.receive()) answer += piece;
  check("the list", answer, robots);
}

// Reads frames until the one that ends the first message, and says what it was.
std::string read_message(Connection& connection, std::string bytes) {
  std::string message;
  const auto need = [&](std::size_t size) {
    while (bytes.size() < size) {
      const std::string more = connection.receive();
      if (more.empty()) throw std::runtime_error{"a page was not welcomed"};
      bytes += more;
    }
  };
  for (;;) {
    need(2);
    const bool is_last = (static_cast<unsigned char>(bytes[0]) & 0x80U) != 0;
    std::size_t size = static_cast<unsigned char>(bytes[1]) & 0x7fU, head = 2;
    if (size >= 126) {
      head = size == 126 ? 4 : 10;
      need(head);
      size = 0;
      for (std::size_t i = 2; i < head; ++i) size = size * 256 + static_cast<unsigned char>(bytes[i]);
    }
    need(head + size);
    message.append(bytes, head, size);
    bytes.erase(0, head + size);
    if (is_last) return message;
  }
}

void be_welcomed(std::uint16_t port, const std::string& token, int robots) {
  Connection connection{port};
  connection.send(request_of("/live", token,
                             "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"));
  std::string bytes;
  while (bytes.find("\r\n\r\n") == std::string::npos) {
    const std::string more = connection.receive();
    if (more.empty()) throw std::runtime_error{"no answer"};
    bytes += more;
  }
  if (!bytes.starts_with("HTTP/1.1 101")) throw std::runtime_error{bytes};
  check("the welcome", read_message(connection, bytes.substr(bytes.find("\r\n\r\n") + 4)), robots);
}

struct Opened {
  std::vector<double> times_ms;
  std::string failure;
};

// One page a second, the first after `delay`.
void open_pages(std::uint16_t port, const std::string& token, int robots, std::chrono::milliseconds delay,
                const std::atomic<bool>& ends, std::atomic<int>& opened, Opened& into) try {
  auto due = Steady::now() + delay;
  while (!ends) {
    std::this_thread::sleep_until(due);
    const auto began = Steady::now();
    list_robots(port, token, robots);
    be_welcomed(port, token, robots);
    into.times_ms.push_back(std::chrono::duration<double, std::milli>(Steady::now() - began).count());
    ++opened;
    due += std::chrono::seconds{1};
  }
} catch (const std::exception& error) {
  into.failure = error.what();
  ++opened;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 5) throw std::runtime_error{"page_openers PORT TOKEN PAGES_A_SECOND ROBOTS"};
  const auto port = static_cast<std::uint16_t>(std::stoi(argv[1]));
  const int pages = std::stoi(argv[3]), robots = std::stoi(argv[4]);
  std::atomic<bool> ends = false;
  std::atomic<int> opened = 0;
  std::vector<Opened> all(static_cast<std::size_t>(pages));
  std::vector<std::thread> threads;
  for (int i = 0; i < pages; ++i) {
    threads.emplace_back(open_pages, port, std::string{argv[2]}, robots, std::chrono::milliseconds{1000 * i / pages},
                         std::cref(ends), std::ref(opened), std::ref(all[static_cast<std::size_t>(i)]));
  }
  while (opened < pages) std::this_thread::sleep_for(std::chrono::milliseconds{10});
  std::cout << "ready" << std::endl;
  while (std::cin.get() != std::char_traits<char>::eof()) continue;
  ends = true;
  for (std::thread& thread : threads) thread.join();
  std::vector<double> times_ms;
  for (const Opened& one : all) {
    if (!one.failure.empty()) throw std::runtime_error{one.failure};
    times_ms.insert(times_ms.end(), one.times_ms.begin(), one.times_ms.end());
  }
  if (times_ms.empty()) throw std::runtime_error{"no page opened"};
  std::ranges::sort(times_ms);
  std::cout << times_ms.size() << ' ' << times_ms[times_ms.size() / 2] << ' ' << times_ms.back() << std::endl;
  return 0;
} catch (const std::exception& error) {
  std::cerr << "page_openers: " << error.what() << '\n';
  return 1;
}
