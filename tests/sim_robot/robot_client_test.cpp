// The simulated robot over a real TCP connection: it dials, obeys, survives losses, and never waits for the network.
#include "sim_robot/client/robot_client.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <optional>
#include <vector>

#include "sim_robot/lab/station_peer.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using namespace std::chrono_literals;

// One robot and the acceptor it dials, on one loop. The station's side is written out in each test.
class Loopback : public ::testing::Test {
 protected:
  Loopback() : acceptor(loop, {asio::ip::address_v4::loopback(), 0}), connection(loop) {
    SimulatedRobotConfig config;
    config.boot_id = random_boot_id();
    const StationAddress address{"127.0.0.1", std::to_string(acceptor.local_endpoint().port())};
    client.emplace(loop, config, address, [this](const std::string& line) { log.push_back(line); });
    asio::co_spawn(loop, client->run(), [](const std::exception_ptr& error) {
      if (error) std::rethrow_exception(error);
    });
    accept();
  }

  void accept() {
    acceptor.async_accept(connection, [this](const boost::system::error_code& error) {
      if (error) return;
      ++connections;
      reader.reset();
      read();
    });
  }
  void read() {
    connection.async_read_some(asio::buffer(bytes), [this](const boost::system::error_code& error, std::size_t size) {
      if (error) {
        closed = true;
        return;
      }
      protocol::Bytes input{bytes.data(), size};
      while (!input.empty() && reader.push(input) == protocol::FrameReader::State::complete) {
        if (const auto frame = protocol::decode_robot_frame(reader.payload())) frames.push_back(*frame);
      }
      if (reading) read();
    });
  }
  void send(const protocol::StationFrame& frame) {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> out;
    const std::size_t size = protocol::write_frame(frame, out.data(), out.size());
    asio::write(connection, asio::buffer(out, size));
  }
  // The link outlives a stall of the machine, unless the test is about silence.
  void welcome(protocol::RefusalReason refusal = rheonaut_REFUSAL_REASON_NONE, std::uint32_t link_timeout_ms = 5000) {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    frame.body.welcome.refusal = refusal;
    frame.body.welcome.link_timeout_ms = link_timeout_ms;
    send(frame);
  }
  void command(protocol::Command command, std::uint64_t life_us = 5'000'000) {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    command.command_id = ++last_command_id;
    command.boot_id = client->robot().config().boot_id;
    command.valid_until_robot_us = client->robot().robot_time_us() + life_us;
    frame.body.command = command;
    send(frame);
  }
  bool has(int body) const {
    return std::any_of(frames.begin(), frames.end(), [body](const auto& frame) { return frame.which_body == body; });
  }
  std::optional<protocol::CommandAck> ack() const {
    for (const auto& frame : frames) {
      if (frame.which_body == rheonaut_RobotFrame_command_ack_tag) return frame.body.command_ack;
    }
    return std::nullopt;
  }
  // Nothing here runs meanwhile, as when the process is stopped.
  void stall(std::chrono::milliseconds duration) { asio::steady_timer{loop, duration}.wait(); }
  bool said(const std::string& text) const {
    return std::any_of(log.begin(), log.end(), [&](const auto& line) { return line.find(text) != line.npos; });
  }
  // Runs the loop until the condition holds. Returns false after 2 min: the wait ends then, and no time is judged.
  template <class Condition>
  bool run_until(Condition condition) {
    const auto give_up_at = std::chrono::steady_clock::now() + 2min;
    while (!condition() && std::chrono::steady_clock::now() < give_up_at) loop.run_one_for(100ms);
    return condition();
  }
  // Drops the connection on this side and waits for the robot to dial again.
  bool redial() {
    const int before = connections;
    connection = tcp::socket{loop};
    accept();
    return run_until([&] { return connections > before; });
  }

  asio::io_context loop{1};
  tcp::acceptor acceptor;
  tcp::socket connection;
  std::array<std::uint8_t, 4096> bytes{};
  protocol::FrameReader reader;
  std::vector<protocol::RobotFrame> frames;
  std::vector<std::string> log;
  int connections = 0;
  bool reading = true;
  bool closed = false;
  std::uint64_t last_command_id = 0;
  std::optional<RobotClient> client;
};

TEST_F(Loopback, SaysHelloAndSendsTelemetryAfterWelcome) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  EXPECT_EQ(frames.front().which_body, pb_size_t{rheonaut_RobotFrame_hello_tag});
  EXPECT_EQ(frames.size(), 1u);
  welcome();
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_telemetry_tag); }));
  EXPECT_TRUE(said("connected"));
}

TEST_F(Loopback, ObeysACommandAndStopsWithoutWaitingForATick) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  welcome();
  command(set_duty(0.5F));
  ASSERT_TRUE(run_until([&] { return client->robot().core().duty() == 0.5F; }));
  command(emergency_stop());
  ASSERT_TRUE(run_until([&] { return client->robot().core().mode() == rheonaut_MODE_EMERGENCY; }));
  EXPECT_EQ(client->robot().core().duty(), 0);
  ASSERT_TRUE(run_until([&] {
    return std::any_of(frames.begin(), frames.end(), [](const auto& frame) {
      return frame.which_body == rheonaut_RobotFrame_command_ack_tag && frame.body.command_ack.emergency_id != 0;
    });
  }));
}

TEST_F(Loopback, DialsAgainAfterACut) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  welcome();
  ASSERT_TRUE(run_until([&] { return client->robot().core().link_up(); }));
  frames.clear();
  ASSERT_TRUE(redial());
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  EXPECT_TRUE(said("connection lost"));
}

TEST_F(Loopback, DialsAgainWhenTheStationFallsSilent) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  welcome(rheonaut_REFUSAL_REASON_NONE, 300);  // and not a word after it
  ASSERT_TRUE(run_until([&] { return closed; }));
  EXPECT_TRUE(said("silent"));
  ASSERT_TRUE(redial());
}

TEST_F(Loopback, SaysWhyItWasRefusedAndTriesAgain) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  welcome(rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT);
  ASSERT_TRUE(run_until([&] { return said("refused by the station: unknown_robot"); }));
  ASSERT_TRUE(redial());
}

TEST_F(Loopback, ClosesAConnectionThatSpeaksSomethingElse) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  asio::write(connection, asio::buffer("HTTP/1.1 400 Bad Request\r\n\r\n", 28));
  ASSERT_TRUE(run_until([&] { return closed; }));
  ASSERT_TRUE(redial());
}

TEST_F(Loopback, TicksOnWhileNobodyReads) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  reading = false;
  welcome();
  const auto before_us = client->robot().robot_time_us();
  ASSERT_TRUE(run_until([&] { return client->robot().robot_time_us() > before_us + 500'000; }));
}

TEST_F(Loopback, WhatWaitsInAStalledRobotExpires) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  welcome();
  ASSERT_TRUE(run_until([&] { return client->robot().core().link_up(); }));
  const auto before_us = client->robot().robot_time_us();
  command(set_duty(0.5F), 100'000);
  stall(300ms);
  ASSERT_TRUE(run_until([&] { return ack().has_value(); }));
  EXPECT_EQ(ack()->result, rheonaut_COMMAND_RESULT_EXPIRED);
  EXPECT_EQ(client->robot().core().duty(), 0);
  EXPECT_GE(client->robot().robot_time_us(), before_us + 290'000);
}

TEST_F(Loopback, AStopThatWaitsInAStalledRobotIsObeyed) {
  ASSERT_TRUE(run_until([&] { return has(rheonaut_RobotFrame_hello_tag); }));
  welcome(rheonaut_REFUSAL_REASON_NONE, 100);
  ASSERT_TRUE(run_until([&] { return client->robot().core().link_up(); }));
  command(emergency_stop());
  stall(300ms);  // the silence time-out passes, too
  client->tick();
  EXPECT_EQ(connections, 1) << "no verdict before the stop is read";
  ASSERT_TRUE(run_until([&] { return ack().has_value(); }));
  EXPECT_EQ(client->robot().core().mode(), rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(connections, 1);
}

TEST(RobotClient, KeepsTryingAStationThatIsNotThere) {
  asio::io_context loop{1};
  tcp::socket nobody{loop, {asio::ip::address_v4::loopback(), 0}};  // has the port, and does not listen
  const std::string port = std::to_string(nobody.local_endpoint().port());
  std::vector<std::string> log;
  RobotClient client{loop, {}, {"127.0.0.1", port}, [&](const std::string& line) { log.push_back(line); }};
  asio::co_spawn(loop, client.run(), [](const std::exception_ptr&) {});
  const auto give_up_at = std::chrono::steady_clock::now() + 2min;
  const auto attempts = [&client] { return client.connection().counts().unreachable; };
  while (attempts() < 3 && std::chrono::steady_clock::now() < give_up_at) loop.run_one_for(100ms);
  EXPECT_GE(attempts(), 3u);
  ASSERT_EQ(log.size(), 1u) << "each thing is said once";
  EXPECT_NE(log[0].find("cannot reach"), std::string::npos);
  EXPECT_GT(client.robot().robot_time_us(), 0u);
}

TEST(Check, RefusesNamesTokensAndRangesThatCannotBe) {
  const auto with = [](auto change) {
    SimulatedRobotConfig config;
    change(config);
    return config;
  };
  EXPECT_NO_THROW(check(SimulatedRobotConfig{}));
  EXPECT_THROW(check(with([](auto& c) { c.robot_id = ""; })), std::invalid_argument);
  EXPECT_THROW(check(with([](auto& c) { c.robot_id = "Robot 1"; })), std::invalid_argument);
  EXPECT_THROW(check(with([](auto& c) { c.robot_id = std::string(32, 'a'); })), std::invalid_argument);
  EXPECT_THROW(check(with([](auto& c) { c.token = std::string(72, 'a'); })), std::invalid_argument);
  EXPECT_THROW(check(with([](auto& c) { c.boot_id = 0; })), std::invalid_argument);
  EXPECT_THROW(check(with([](auto& c) { c.duty = {0.1F, 1}; })), std::invalid_argument);
  EXPECT_THROW(check(with([](auto& c) { c.duty = {-1, 0}; })), std::invalid_argument);
}

TEST(ParseBootId, TakesHexadecimalOtherThanZero) {
  EXPECT_EQ(parse_boot_id("0xB007"), 0xB007u);
  EXPECT_EQ(parse_boot_id("ffffffffffffffff"), UINT64_MAX);
  for (const char* bad : {"", "0", "0x", "xyz", "12 ", "10000000000000000", "-1"}) {
    EXPECT_THROW(parse_boot_id(bad), std::invalid_argument) << bad;
  }
}

}  // namespace
}  // namespace sim_robot
