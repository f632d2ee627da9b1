// The HTTP of the bare loop: the least that can ask for a stop and answer when the robot has.
#pragma once

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace bare {

inline int listen_on_loopback() {
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 || listen(listener, 4096) != 0) {
    throw std::runtime_error{"cannot listen on the loopback address"};
  }
  return listener;
}

inline std::uint16_t port_of(int listener) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin_port);
}

// Believes everything: one read is one request, since its client sends them so and waits for each answer.
class StopDesk {
 public:
  int listener() const { return listener_; }

  int accept_asker() const {  // below 0: there was none
    const int fd = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK);
    const int on = 1;
    if (fd >= 0) setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return fd;
  }

  // What was sent; empty at the end of the connection.
  std::string_view read(int fd) {
    const ssize_t got = recv(fd, input_.data(), input_.size(), 0);
    if (got <= 0) close(fd);
    return {input_.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0))};
  }

  // The robot to stop, as the path names it behind its fourth slash.
  static std::string_view robot_of(std::string_view request) {
    std::size_t begin = 0;
    for (int slash = 0; slash < 4; ++slash) begin = request.find('/', begin) + 1;
    return request.substr(begin, request.find('/', begin) - begin);
  }

  std::uint64_t new_stop(int asker) {
    waiting_.emplace_back(++last_stop_, asker);
    return last_stop_;
  }

  void answer_stop(std::uint64_t stop) {
    const auto of =
        std::find_if(waiting_.begin(), waiting_.end(), [stop](const auto& one) { return one.first == stop; });
    if (of == waiting_.end()) return;
    answer(of->second, "200 OK");
    waiting_.erase(of);
  }

  static void answer(int asker, std::string_view status) {
    const std::string text = "HTTP/1.1 " + std::string{status} + "\r\nContent-Length: 2\r\n\r\n{}";
    send(asker, text.data(), text.size(), MSG_NOSIGNAL);
  }

 private:
  int listener_ = listen_on_loopback();
  std::uint64_t last_stop_ = 0;
  std::vector<std::pair<std::uint64_t, int>> waiting_;  // stops on their way, and who asked for each
  std::array<char, 65536> input_{};
};

}  // namespace bare
