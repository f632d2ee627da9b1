// Sockets of this process in a PollSet, which note what is read of them, in virtual time.
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/net/poll_set.hpp"
#include "server/runtime/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {

namespace asio = boost::asio;
using namespace std::chrono_literals;

// A connection within this process: the near end is in the set.
class Line {
 public:
  explicit Line(net::PollSet& set)
      : ends_{make_pair()}, socket_{std::make_unique<net::PollSet::Socket>(set, ends_.near)} {}
  ~Line() {
    socket_.reset();
    hang_up();
    ::close(ends_.near);
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  void say(char byte) const { ASSERT_EQ(::send(ends_.far, &byte, 1, MSG_NOSIGNAL), 1); }
  void end_sending() const { ::shutdown(ends_.far, SHUT_WR); }
  void hang_up() {
    if (ends_.far >= 0) ::close(ends_.far);
    ends_.far = -1;
  }
  void fill() const {
    const std::vector<char> bytes(4096);
    while (::send(ends_.near, bytes.data(), bytes.size(), MSG_DONTWAIT) > 0) continue;
  }
  void drain() const {
    std::vector<char> bytes(4096);
    while (::recv(ends_.far, bytes.data(), bytes.size(), MSG_DONTWAIT) > 0) continue;
  }
  // What one call reads: a byte; nothing at the end.
  std::optional<char> take() const {
    char byte = 0;
    return ::recv(ends_.near, &byte, 1, MSG_DONTWAIT) == 1 ? std::optional{byte} : std::nullopt;
  }

  net::PollSet::Socket& socket() { return *socket_; }
  void leave() { socket_.reset(); }

 private:
  struct Ends {
    int near = -1, far = -1;
  };
  static Ends make_pair() {
    std::array<int, 2> ends{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
    return {ends[0], ends[1]};
  }

  Ends ends_;
  std::unique_ptr<net::PollSet::Socket> socket_;
};

class PollSetTest : public ::testing::Test {
 protected:
  PollSetTest() {
    tasks.spawn("all", set->run());
    tasks.spawn("awaited", set->run_awaited());
    tasks.spawn("quiet", set->run_quiet());
    clock.settle();
  }
  ~PollSetTest() override {
    tasks.stop();
    clock.settle();
  }

  // Lines that note what they read under their number.
  void add_lines(int count) {
    for (int i = 0; i < count; ++i) {
      lines.push_back(std::make_unique<Line>(*set));
      Line* line = lines.back().get();
      const int number = static_cast<int>(lines.size()) - 1;
      line->socket().watch([this, line, number] {
        if (line->take()) received.push_back(number);
      });
    }
  }
  void add_quiet_lines(int count) {
    const std::size_t before = lines.size();
    add_lines(count);
    for (std::size_t i = before; i < lines.size(); ++i) lines[i]->socket().set_pace(net::ReadPace::quiet);
  }
  void all_say() {
    for (const auto& line : lines) line->say('x');
  }

  asio::awaitable<void> wait_for_room(Line& line) {
    try {
      co_await line.socket().writable();
      waits_ended.push_back("room");
    } catch (const boost::system::system_error& error) {
      waits_ended.push_back(error.code() == asio::error::operation_aborted ? "cancelled" : error.what());
      throw;
    }
  }

  asio::io_context loop;
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  std::unique_ptr<net::PollSet> set = std::make_unique<net::PollSet>(loop, clock);
  std::vector<std::unique_ptr<Line>> lines;
  std::vector<int> received;
  std::vector<std::string> waits_ended;
};

}  // namespace server
