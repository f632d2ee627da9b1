// The proxy over real sockets: every byte passes, and each fault is seen on both sides.
#include "tests/sim_robot/proxy_fixture.hpp"

namespace sim_robot {
namespace {

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
  const tcp::socket nobody{loop, {asio::ip::address_v4::loopback(), 0}};  // has the port, and does not listen
  const std::string port = std::to_string(nobody.local_endpoint().port());
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
  } catch (const std::runtime_error& error) {
    const std::string address = "127.0.0.1:" + std::to_string(target.local_endpoint().port());
    EXPECT_EQ(std::string(error.what()),
              "cannot listen on " + address + ": another program listens there; stop it, or choose another port");
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
  EXPECT_EQ(proxy->impairments().up.loss_probability, 0);
  EXPECT_EQ(proxy->control("  delay   50 "), "ok: delay 50");
  EXPECT_EQ(proxy->impairments().up.delay_s, 0.05);
  EXPECT_EQ(proxy->control("heal"), "ok: heal");
  EXPECT_EQ(proxy->impairments().up.delay_s, 0);
}

}  // namespace
}  // namespace sim_robot
