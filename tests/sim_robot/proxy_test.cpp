// The proxy over real sockets: every byte passes, faults are seen on both sides, and a robot comes back through it.
#include "sim_robot/proxy.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/write.hpp>
#include <optional>

namespace sim_robot {
namespace {

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
      if (loop.run_one_for(2s) == 0) break;
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
  template <class Condition>
  bool run_until(Condition condition) {
    const auto give_up_at = Clock::now() + 10s;
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

TEST_F(ProxyTest, PassesBytesAndTheEndOfEachDirection) {
  start();
  EXPECT_TRUE(said("listening on 127.0.0.1:" + std::to_string(proxy->endpoint().port())));
  const auto [client, server] = connect();
  client.send("up");
  server.send("down");
  ASSERT_TRUE(run_until([&] { return server.received == "up" && client.received == "down"; }));
  client.socket.shutdown(tcp::socket::shutdown_send);
  ASSERT_TRUE(run_until([&] { return server.ended == asio::error::eof; }));
  EXPECT_FALSE(client.ended);
  server.socket.shutdown(tcp::socket::shutdown_send);
  ASSERT_TRUE(run_until([&] { return client.ended == asio::error::eof && proxy->open_connections() == 0; }));
}

TEST_F(ProxyTest, EveryByteArrivesOnceAndInOrder) {
  for (const std::size_t split : {0U, 1U, 7U}) {
    ProxyOptions options;
    options.impairment.delay_s = 0.002;
    options.impairment.jitter_s = 0.005;
    options.impairment.split_bytes = split;
    start(options);
    const auto [client, server] = connect();
    client.send(long_text(40'000));
    server.send(long_text(30'000));
    ASSERT_TRUE(run_until([&] { return server.received.size() == 40'000 && client.received.size() == 30'000; }));
    EXPECT_EQ(server.received, client.sent);
    EXPECT_EQ(client.received, server.sent);
    stop();
  }
}

TEST_F(ProxyTest, DelayIsSeenInEachDirection) {
  ProxyOptions options;
  options.impairment.delay_s = 0.06;
  start(options);
  const auto [client, server] = connect();
  const auto begin = Clock::now();
  client.send("ping");
  ASSERT_TRUE(run_until([&, &s = server] { return s.received == "ping"; }));
  EXPECT_GE(seconds_since(begin), 0.06);
  server.send("pong");
  ASSERT_TRUE(run_until([&, &c = client] { return c.received == "pong"; }));
  EXPECT_GE(seconds_since(begin), 0.12);
}

TEST_F(ProxyTest, ThrottleHoldsItsRate) {
  ProxyOptions options;
  options.impairment.bytes_per_s = 100'000;
  start(options);
  const auto [client, server] = connect();
  const auto begin = Clock::now();
  client.send(long_text(40'000));
  ASSERT_TRUE(run_until([&, &s = server] { return s.received.size() == 40'000; }));
  EXPECT_GE(seconds_since(begin), 0.4);
}

TEST_F(ProxyTest, ACutIsTheEndOfTheStreamOnBothSides) {
  start();
  const auto [client, server] = connect();
  EXPECT_EQ(proxy->control("cut"), "ok: cut");
  ASSERT_TRUE(run_until([&, &c = client, &s = server] { return c.ended && s.ended; }));
  EXPECT_EQ(client.ended, asio::error::eof);
  EXPECT_EQ(server.ended, asio::error::eof);
  ASSERT_TRUE(run_until([&] { return proxy->open_connections() == 0; })) << "also when nobody closes";
}

TEST_F(ProxyTest, AResetIsAResetOnBothSides) {
  start();
  const auto [client, server] = connect();
  proxy->control("reset");
  ASSERT_TRUE(run_until([&, &c = client, &s = server] { return c.ended && s.ended; }));
  EXPECT_EQ(client.ended, asio::error::connection_reset);
  EXPECT_EQ(server.ended, asio::error::connection_reset);
}

TEST_F(ProxyTest, AResetOfOneSideReachesTheOther) {
  start();
  const auto [client, server] = connect();
  client.socket.set_option(asio::socket_base::linger{true, 0});
  client.socket.close();
  ASSERT_TRUE(run_until([&, &s = server] { return bool{s.ended}; }));
  EXPECT_EQ(server.ended, asio::error::connection_reset);
}

TEST_F(ProxyTest, HalfOpenSwallowsBytesAndEndsWhileOthersPass) {
  start();
  const auto [client, server] = connect();
  proxy->control("half-open");
  client.send("into the void");
  client.socket.shutdown(tcp::socket::shutdown_send);
  const auto [other_client, other_server] = connect();
  for (int i = 1; i <= 5; ++i) {
    other_client.send("x");
    ASSERT_TRUE(run_until([&, &s = other_server] { return s.received.size() == static_cast<std::size_t>(i); }));
  }
  EXPECT_EQ(server.received, "");
  EXPECT_FALSE(server.ended);
  EXPECT_FALSE(client.ended);
  proxy->control("heal");
  ASSERT_TRUE(run_until([&, &s = server] { return s.ended == asio::error::eof; }));
  EXPECT_EQ(server.received, "into the void");
}

TEST_F(ProxyTest, HalfOpenInOneDirectionLeavesTheOther) {
  start();
  const auto [client, server] = connect();
  proxy->control("half-open up");
  client.send("lost");
  server.send("heard");
  ASSERT_TRUE(run_until([&, &c = client] { return c.received == "heard"; }));
  EXPECT_EQ(server.received, "");
}

TEST_F(ProxyTest, AnOutageHoldsBytesAndNewConnectionsUntilItsEnd) {
  start();
  const auto [client, server] = connect();
  const auto begin = Clock::now();
  EXPECT_EQ(proxy->control("outage 0.3"), "ok: outage 0.3");
  client.send("late");
  const auto [other_client, other_server] = connect();
  EXPECT_GE(seconds_since(begin), 0.3);
  ASSERT_TRUE(run_until([&, &s = server] { return s.received == "late"; }));
  other_client.send("too");
  ASSERT_TRUE(run_until([&, &s = other_server] { return s.received == "too"; }));
  EXPECT_TRUE(said("outage over"));
}

TEST_F(ProxyTest, APlannedOutageBeginsByItself) {
  ProxyOptions options;
  options.outages = {{0.05, 0.1}};
  start(options);
  ASSERT_TRUE(run_until([&] { return said("outage over"); }));
}

TEST_F(ProxyTest, AnOutageMayEndInAReset) {
  start();
  const auto [client, server] = connect();
  proxy->control("outage 0.05 reset");
  ASSERT_TRUE(run_until([&, &c = client, &s = server] { return c.ended && s.ended; }));
  EXPECT_EQ(client.ended, asio::error::connection_reset);
}

TEST_F(ProxyTest, AnUnreachableTargetClosesTheClientWithALineAndTheProxyGoesOn) {
  const std::string port = std::to_string(target.local_endpoint().port());
  target.close();
  ProxyOptions options;
  options.target = {"127.0.0.1", port};
  start(options);
  for (int i = 0; i < 2; ++i) {
    End& client = new_end();
    client.socket.connect(proxy->endpoint());
    client.read();
    ASSERT_TRUE(run_until([&] { return bool{client.ended}; }));
  }
  EXPECT_TRUE(said("cannot reach 127.0.0.1:" + port + ": connection 2 is closed"));
}

TEST_F(ProxyTest, ATakenPortIsNamed) {
  ProxyOptions options;
  options.listen = target.local_endpoint();
  try {
    start(options);
    FAIL() << "listens on a port that is taken";
  } catch (const boost::system::system_error& error) {
    const std::string address = "127.0.0.1:" + std::to_string(target.local_endpoint().port());
    EXPECT_NE(std::string(error.what()).find("cannot listen on " + address), std::string::npos) << error.what();
  }
}

TEST_F(ProxyTest, AnswersWhatItDoesNotUnderstand) {
  start();
  EXPECT_NE(proxy->control("explode").find("unknown word 'explode'; say one of: cut, delay"), std::string::npos);
  EXPECT_NE(proxy->control("").find("say one of"), std::string::npos);
  EXPECT_EQ(proxy->control("delay"), "'delay' needs a number");
  EXPECT_EQ(proxy->control("delay 5 6"), "too many words after 'delay'");
  EXPECT_EQ(proxy->control("outage 1 perhaps"), "'perhaps' is not reset");
  EXPECT_EQ(proxy->control("half-open sideways"), "'sideways' is not up, down or both");
  EXPECT_EQ(proxy->control("split 1.5"), "'1.5' is not a whole number");
  for (const char* bad : {"delay -1", "delay nan", "delay inf", "delay 5x", "outage 1e9", "loss 2", "loss 1"}) {
    EXPECT_NE(proxy->control(bad).substr(0, 3), "ok:") << bad;
  }
  EXPECT_EQ(proxy->impairment().loss_probability, 0);
  EXPECT_EQ(proxy->control("  delay   50 "), "ok: delay 50");
  EXPECT_EQ(proxy->impairment().delay_s, 0.05);
  EXPECT_EQ(proxy->control("heal"), "ok: heal");
  EXPECT_EQ(proxy->impairment().delay_s, 0);
}

// The least of a station behind the proxy: it welcomes, and answers telemetry with a sign of life.
class RobotThroughProxy : public ProxyTest {
 protected:
  void begin() {
    start();
    accept();
    const auto& at = proxy->endpoint();
    SimulatedRobotConfig config;
    config.boot_id = random_boot_id();
    robot.emplace(loop, config, StationAddress{"127.0.0.1", std::to_string(at.port())},
                  [this](const std::string& line) { log.push_back(line); });
    // The robot runs until the loop has gone; its frame is destroyed with the loop.
    asio::co_spawn(loop, robot->run(), [](const std::exception_ptr&) {});
    ASSERT_TRUE(run_until([&] { return robot->robot().core().link_up() && samples > 5; }));
  }
  ~RobotThroughProxy() override {
    for (auto& end : ends) end->socket.close();
    if (proxy) proxy->stop();
    target.close();
    loop.run_for(50ms);
    loop.stop();  // the robot dials for ever
  }
  void accept() {
    End& end = new_end();
    target.async_accept(end.socket, [this, &end](const boost::system::error_code& error) {
      if (error) return;
      ++connections;
      reader.reset();
      read(end);
      accept();
    });
  }
  void read(End& end) {
    end.socket.async_read_some(asio::buffer(end.bytes), [this, &end](const auto& error, std::size_t size) {
      if (error) {
        end.ended = error;
        return;
      }
      protocol::Bytes input{reinterpret_cast<const std::uint8_t*>(end.bytes.data()), size};
      while (!input.empty() && reader.push(input) == protocol::FrameReader::State::complete) {
        if (const auto frame = protocol::decode_robot_frame(reader.payload())) answer(end, *frame);
      }
      read(end);
    });
  }
  void answer(End& end, const protocol::RobotFrame& heard) {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_heartbeat_tag;
    if (heard.which_body == rheonaut_RobotFrame_hello_tag) {
      frame.which_body = rheonaut_StationFrame_welcome_tag;
      frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    }
    if (heard.which_body == rheonaut_RobotFrame_telemetry_tag) ++samples;
    std::array<std::uint8_t, protocol::kMaxFramedBytes> out;
    const std::size_t size = protocol::write_frame(frame, out.data(), out.size());
    boost::system::error_code ignored;
    asio::write(end.socket, asio::buffer(out, size), ignored);
  }
  // The robot's next connection is up and telemetry comes.
  bool comes_back() {
    const int before = connections;
    if (!run_until([&] { return connections > before; })) return false;
    const int heard = samples;
    return run_until([&] { return robot->robot().core().link_up() && samples > heard + 5; });
  }

  protocol::FrameReader reader;
  int connections = 0, samples = 0;
  std::optional<RobotClient> robot;
};

TEST_F(RobotThroughProxy, ComesBackAfterACutAResetAndHalfOpen) {
  begin();
  proxy->control("cut 3");
  EXPECT_TRUE(comes_back());
  proxy->control("reset");
  EXPECT_TRUE(comes_back());
  EXPECT_FALSE(said("silent"));
  proxy->control("half-open");
  EXPECT_TRUE(comes_back());
  EXPECT_TRUE(said("the station is silent"));
}

TEST_F(RobotThroughProxy, KeepsItsLinkSplitDelayedAndThrottled) {
  begin();
  for (const char* fault : {"split 1", "delay 100", "jitter 50", "throttle 20000"}) {
    EXPECT_EQ(proxy->control(fault).substr(0, 3), "ok:");
    const int heard = samples;
    ASSERT_TRUE(run_until([&] { return samples > heard + 15; })) << fault;
  }
  EXPECT_EQ(connections, 1);
  EXPECT_TRUE(robot->robot().core().link_up());
}

TEST_F(RobotThroughProxy, ComesBackAfterAnOutage) {
  begin();
  proxy->control("outage 1.5");
  ASSERT_TRUE(run_until([&] { return robot->robot().core().link_lost(); }));
  EXPECT_TRUE(comes_back());
  EXPECT_FALSE(robot->robot().core().link_lost());
}

}  // namespace
}  // namespace sim_robot
