// `rheonaut stop` against a station of the test, which answers as it likes.
#include <gmock/gmock.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <functional>
#include <mutex>
#include <sstream>
#include <thread>

#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr const char* kFailed = R"({"title":"the station failed")";  // an answer that begins so has the status 500

// Answers nothing before as many requests have come as it expects; then all, the last one first.
class SlowStation {
 public:
  SlowStation(const std::filesystem::path& data_dir, std::vector<std::string> answers,
              std::function<std::string()> then = {})
      : answers_{std::move(answers)}, then_{std::move(then)} {
    std::filesystem::create_directories(data_dir);
    std::ofstream{data_dir / "rheonaut.token"} << "secret\n";
    std::ofstream{data_dir / "endpoints.json"}
        << nlohmann::json{{"http", "127.0.0.1:" + std::to_string(acceptor_.local_endpoint().port())}};
    thread_ = std::thread{[this] { serve(); }};
  }
  ~SlowStation() { thread_.join(); }
  SlowStation(const SlowStation&) = delete;
  SlowStation& operator=(const SlowStation&) = delete;

 private:
  void serve() {
    std::vector<tcp::socket> open;
    while (open.size() < answers_.size()) {
      open.push_back(acceptor_.accept());
      std::string request;
      asio::read_until(open.back(), asio::dynamic_buffer(request), "\r\n\r\n");
    }
    for (std::size_t i = open.size(); i-- > 0;) answer(open[i], answers_[i]);
    if (!then_) return;
    tcp::socket question = acceptor_.accept();
    answer(question, then_());
  }
  static void answer(tcp::socket& socket, const std::string& body) {
    const std::string status = body.starts_with(kFailed) ? "500 Internal Server Error" : "200 OK";
    const std::string text = "HTTP/1.1 " + status +
                             "\r\nContent-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) +
                             "\r\n\r\n" + body;
    asio::write(socket, asio::buffer(text));
  }

  std::vector<std::string> answers_;
  std::function<std::string()> then_;  // the answer to the question after these
  asio::io_context loop_;
  tcp::acceptor acceptor_{loop_, {asio::ip::address_v4::loopback(), 0}};
  std::thread thread_;
};

std::string confirmed(const std::string& robot_id) {
  return nlohmann::json{{"robot_id", robot_id}, {"state", "acknowledged"}, {"acknowledged_after_us", 1500}}.dump();
}

using StopTool = ToolTest;

// SAFETY: no robot waits until another has answered; one after the other these two would wait for ever.
TEST_F(StopTool, AllRequestsAreOnTheirWayBeforeAnyAnswer) {
  const SlowStation station{folder_ / "data", {confirmed("a"), confirmed("b")}};
  const Answer answer = ask("stop a b --data @data");
  EXPECT_EQ(answer.exit_code, 0) << answer.error;
  EXPECT_THAT(answer.text, ::testing::HasSubstr("a  stopped: the robot confirmed after 1.5 ms\n"));
  EXPECT_THAT(answer.text, ::testing::HasSubstr("b  stopped: the robot confirmed after 1.5 ms\n"));
}

// SAFETY: what was only sent is not a stop.
TEST_F(StopTool, WhatTheRobotHasNotAcknowledgedIsNotConfirmed) {
  const std::string sent = R"({"robot_id":"a","state":"sent","acknowledged_after_us":null})";
  const SlowStation station{folder_ / "data", {sent}};
  const Answer answer = ask("stop a --data @data --json");
  EXPECT_EQ(answer.exit_code, 5);
  EXPECT_EQ(answer.json()["not_confirmed"], 1);
  EXPECT_FALSE(answer.json()["robots"][0]["confirmed"].get<bool>());
}

// A terminal that knows what a person has read so far: what was flushed.
class Terminal : public std::stringbuf {
 public:
  std::string read() const {
    const std::lock_guard lock{mutex_};
    return read_;
  }

 protected:
  int sync() override {
    const std::lock_guard lock{mutex_};
    read_ = str();
    return 0;
  }

 private:
  mutable std::mutex mutex_;
  std::string read_;
};

// SAFETY: the person reads who is not stopped before the tool asks why.
TEST_F(StopTool, TheOutcomeIsPrintedBeforeItsReasonsAreAskedFor) {
  Terminal terminal;
  std::string read_before;
  const std::string sent = R"({"robot_id":"a","state":"sent","acknowledged_after_us":null})";
  const SlowStation station{folder_ / "data", {sent}, [&] {
                              read_before = terminal.read();
                              return std::string{R"({"robot_id":"a","link":"lost"})"};
                            }};
  StopCommand command;
  command.data_dir = folder_ / "data";
  command.robots = {"a"};
  std::ostream out{&terminal};
  EXPECT_EQ(answer(CommandLine{command}, out), 5);
  EXPECT_THAT(read_before, ::testing::StartsWith("a  NOT CONFIRMED\n0 of 1 robots confirmed;"));
  EXPECT_THAT(terminal.str(),
              ::testing::EndsWith("\na: it is not connected; the stop is kept and is sent first when it "
                                  "connects\n"));
}

TEST_F(StopTool, AStationWithoutRobotsHasStoppedNothing) {
  const std::string none = R"({"commands":[],"summary":{"robots":0,"left_out":0,"not_acknowledged":[]}})";
  const SlowStation station{folder_ / "data", {none}};
  const Answer answer = ask("stop --data @data");
  EXPECT_EQ(answer.exit_code, 5);
  EXPECT_THAT(answer.error, ::testing::HasSubstr("this station knows no robot"));
}

// SAFETY: more robots than an answer names are not forgotten.
TEST_F(StopTool, RobotsThatTheAnswerDoesNotNameAreNotConfirmed) {
  const std::string some =
      R"({"commands":[)" + confirmed("a") + R"(],"summary":{"robots":3,"left_out":1,"not_acknowledged":[]}})";
  const SlowStation station{folder_ / "data", {some}};
  const Answer answer = ask("stop --data @data");
  EXPECT_EQ(answer.exit_code, 5);
  EXPECT_THAT(answer.text, ::testing::HasSubstr("1 more  NOT CONFIRMED"));
}

// SAFETY: a request whose answer is lost may have stopped the robots.
TEST_F(StopTool, AnAnswerThatBreaksOffLeavesItOpenWhatWasStopped) {
  const SlowStation station{folder_ / "data", {"{"}};
  const Answer answer = ask("stop a --data @data");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, ::testing::HasSubstr("IT IS NOT KNOWN"));
}

// SAFETY: a station that failed while it answered may have stopped robots before.
TEST_F(StopTool, AStationThatFailsLeavesItOpenWhatWasStopped) {
  const SlowStation station{folder_ / "data", {std::string{kFailed} + "}"}};
  const Answer answer = ask("stop --data @data");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, ::testing::HasSubstr("IT IS NOT KNOWN"));
}

TEST_F(StopTool, WithoutAStationItSaysThatNothingWasStopped) {
  const Answer answer = ask("stop --data @nowhere");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, ::testing::HasSubstr("NOTHING WAS STOPPED"));
  EXPECT_GT(ask("stop a --all").exit_code, 1);
}

}  // namespace
}  // namespace server::cli
