// A proxy between clients and a target on one loop, for tests over real sockets.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/write.hpp>
#include <memory>
#include <optional>

#include "sim_robot/proxy/proxy.hpp"

namespace sim_robot {

namespace asio = boost::asio;
using asio::ip::tcp;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// One end of a connection: reads until it ends.
struct End {
  explicit End(asio::io_context& loop) : socket(loop) {}

  void read() {
    socket.async_read_some(asio::buffer(bytes), [this](const boost::system::error_code& error, std::size_t size) {
      received.append(bytes.data(), size);
      if (error) {
        ended = error;
      } else {
        read();
      }
    });
  }
  void send(std::string text) {
    sent = std::move(text);
    asio::async_write(socket, asio::buffer(sent), [](const boost::system::error_code&, std::size_t) {});
  }

  tcp::socket socket;
  std::array<char, 4096> bytes{};
  std::string received, sent;
  boost::system::error_code ended;
};

class ProxyTest : public ::testing::Test {
 protected:
  ProxyTest() : target(loop, {asio::ip::address_v4::loopback(), 0}) {}
  ~ProxyTest() override {
    target.close();
    stop();
  }

  // Everything ends, and so does the loop by itself.
  void stop() {
    if (proxy) proxy->stop();
    for (auto& end : ends) end->socket.close();
    while (!loop.stopped()) {
      if (loop.run_one_for(2min) == 0) break;
    }
    EXPECT_TRUE(loop.stopped()) << "something still waits";
    loop.restart();
  }

  void start(ProxyOptions options = {}) {
    if (options.target.host.empty()) {
      options.target = {"127.0.0.1", std::to_string(target.local_endpoint().port())};
    }
    proxy.emplace(loop, options, [this](const std::string& line) { log.push_back(line); });
    asio::co_spawn(loop, proxy->run(), [](const std::exception_ptr& error) {
      if (error) std::rethrow_exception(error);
    });
  }
  End& new_end() { return *ends.emplace_back(std::make_unique<End>(loop)); }
  // A client of the proxy and the connection that the target accepts for it.
  std::pair<End&, End&> connect() {
    End& client = new_end();
    End& server = new_end();
    bool accepted = false;
    client.socket.connect(proxy->endpoint());
    target.async_accept(server.socket, [&](const boost::system::error_code& error) { accepted = !error; });
    EXPECT_TRUE(run_until([&] { return accepted; }));
    client.read();
    server.read();
    return {client, server};
  }
  // Returns false after 2 min: the wait ends then, and no time is judged.
  template <class Condition>
  bool run_until(Condition condition) {
    const auto give_up_at = Clock::now() + 2min;
    while (!condition() && Clock::now() < give_up_at) loop.run_one_for(100ms);
    return condition();
  }
  bool said(const std::string& text) const {
    return std::any_of(log.begin(), log.end(), [&](const auto& line) { return line.find(text) != line.npos; });
  }
  static std::string long_text(std::size_t size) {
    std::string text;
    for (std::size_t i = 0; text.size() < size; ++i) text += std::to_string(i) + " ";
    text.resize(size);
    return text;
  }
  static double seconds_since(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
  }

  asio::io_context loop{1};
  tcp::acceptor target;
  std::vector<std::unique_ptr<End>> ends;
  std::vector<std::string> log;
  std::optional<Proxy> proxy;
};

}  // namespace sim_robot
