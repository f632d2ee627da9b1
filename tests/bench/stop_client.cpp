// Stops one robot again and again over HTTP, on one connection, and measures each from the first byte of the request to
// the last of the answer: the clock of tests/bench/stop_bench.
//
//   stop_client PORT PATH COUNT PAUSE_US [TOKEN]
//
// Prints one time a line, in nanoseconds. Exit status 1 when an answer is not 200.
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "loopback.hpp"

using bare::connect_to;
using bare::send_all;

namespace {

// Reads one answer to its end; false unless it is 200.
bool read_answer(int fd) {
  std::string text;
  std::size_t whole = std::string::npos;
  while (text.size() < whole) {
    char bytes[4096];
    const ssize_t got = recv(fd, bytes, sizeof bytes, 0);
    if (got <= 0) throw std::runtime_error{"the connection ended"};
    text.append(bytes, static_cast<std::size_t>(got));
    const std::size_t body = text.find("\r\n\r\n");
    if (whole != std::string::npos || body == std::string::npos) continue;
    const std::size_t length = text.find("Content-Length: ");
    if (length > body) throw std::runtime_error{"an answer without a length"};
    whole = body + 4 + std::strtoul(text.c_str() + length + 16, nullptr, 10);
  }
  return text.starts_with("HTTP/1.1 200");
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 5) throw std::runtime_error{"stop_client PORT PATH COUNT PAUSE_US [TOKEN]"};
  const int fd = connect_to(static_cast<std::uint16_t>(std::stoi(argv[1])));
  const std::string authorization = argc > 5 ? std::string{"Authorization: Bearer "} + argv[5] + "\r\n" : "";
  const std::string request =
      std::string{"POST "} + argv[2] + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + authorization + "Content-Length: 0\r\n\r\n";
  std::vector<std::int64_t> times_ns;
  for (int left = std::stoi(argv[3]); left > 0; --left) {
    std::this_thread::sleep_for(std::chrono::microseconds{std::stoi(argv[4])});
    const auto began = std::chrono::steady_clock::now();
    send_all(fd, request);
    if (!read_answer(fd)) throw std::runtime_error{"an answer that is not 200"};
    times_ns.push_back((std::chrono::steady_clock::now() - began).count());
  }
  for (const std::int64_t time_ns : times_ns) std::cout << time_ns << '\n';
  return 0;
} catch (const std::exception& error) {
  std::cerr << "stop_client: " << error.what() << '\n';
  return 1;
}
