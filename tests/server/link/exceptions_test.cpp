// A robot's session that fails inside: it ends alone, the log says why, it is counted, and the station goes on.
#include <cstring>

#include "tests/server/captured_log.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

// A sink that fails, as nothing in the station should.
class Thrower final : public station::StationSink {
 public:
  void on_samples(const station::RobotState& robot, const station::SampleBatch&) override {
    if (robot.id == "r1") throw std::runtime_error{"no room for a sample"};
  }
  void on_event(const station::RobotState&, const station::RobotEvent& event) override {
    if (event.kind == kind_that_fails) throw std::runtime_error{"no room for an event"};
  }
  void on_command(const station::CommandRecord& record) override {
    if (record.state == station::CommandState::sent) throw std::runtime_error{"no room for a command"};
  }

  std::string kind_that_fails = "none";
};

class SessionExceptionTest : public LinkTest {
 protected:
  SessionExceptionTest() { station.add_sink(thrower); }

  TestRobot* connect_other() {
    auto* other = dial();
    auto hello = TestRobot::hello_frame();
    std::strcpy(hello.body.hello.robot_id, "r2");
    hello.body.hello.boot_id = 78;
    other->send(hello);
    EXPECT_TRUE(clock.run_until([&] { return !other->welcomes().empty(); }, 1s));
    other->keep_talking();
    return other;
  }
  std::uint64_t counted() { return tasks.exceptions().count(runtime::Ended::robot_session); }
  void expect_alive() {
    EXPECT_EQ(tasks.exit_code(), 0);
    EXPECT_FALSE(tasks.stopping());
  }

  CapturedLog log;
  Thrower thrower;
};

TEST_F(SessionExceptionTest, OfReadingEndsThatSessionAloneAndIsLoggedWithTheRobot) {
  const auto* other = connect_other();
  auto* robot = connect();
  robot->send_samples(0, 5, robot->robot_now_us(), 0);
  clock.settle();
  EXPECT_TRUE(robot->closed);
  EXPECT_FALSE(connected());
  EXPECT_EQ(counted(), 1U);
  EXPECT_TRUE(log.has("robot 'r1', memory: no room for a sample")) << log.text();
  EXPECT_FALSE(other->closed);
  EXPECT_EQ(station.find("r2")->link, station::LinkState::connected);
  expect_alive();
}

TEST_F(SessionExceptionTest, OfWritingEndsTheSessionToo) {
  auto* robot = connect();
  submit(set_duty(0.1F));
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 1U);
  EXPECT_TRUE(robot->closed) << "it does not go on half";
  EXPECT_FALSE(connected());
  EXPECT_EQ(counted(), 1U);
  EXPECT_TRUE(log.has("no room for a command")) << log.text();
  expect_alive();
}

TEST_F(SessionExceptionTest, OfItsEndStopsNothing) {
  thrower.kind_that_fails = "disconnected";
  auto* robot = connect();
  robot->link.cut();
  clock.settle();
  EXPECT_FALSE(connected());
  EXPECT_EQ(counted(), 1U);
  EXPECT_TRUE(log.has("no room for an event")) << log.text();
  expect_alive();
}

TEST_F(SessionExceptionTest, ComesInOneLineASecondAndCountsAll) {
  const auto fail_once = [this] {
    auto* robot = connect();
    robot->send_samples(0, 5, robot->robot_now_us(), 0);
    clock.settle();
  };
  for (int i = 0; i < 20; ++i) fail_once();
  EXPECT_EQ(counted(), 20U);
  EXPECT_EQ(log.lines_with("no room for a sample"), 1U) << log.text();
  clock.run_for(1s);
  fail_once();
  EXPECT_EQ(counted(), 21U);
  EXPECT_TRUE(log.has("no room for a sample (and 19 before)")) << log.text();
}

TEST_F(SessionExceptionTest, OfTwoWithinASecondBothNamesAndBothTextsAreLogged) {
  runtime::ExceptionLog exceptions;
  const auto note = [&](const std::string& which, const char* text) {
    exceptions.note(runtime::Ended::request, which, std::make_exception_ptr(std::runtime_error{text}),
                    clock.steady_us());
  };
  note("GET /api/v1/runs", "disk full");
  note("GET /api/v1/robots", "disk full");
  note("GET /api/v1/robots", "no such table");
  EXPECT_EQ(log.lines_with("GET /api/v1/runs: disk full"), 1U) << log.text();
  EXPECT_EQ(log.lines_with("GET /api/v1/robots: disk full"), 1U) << log.text();
  EXPECT_EQ(log.lines_with("GET /api/v1/robots: no such table"), 1U) << log.text();
}

// A client that chooses the text can fill neither the log nor the memory.
TEST_F(SessionExceptionTest, OfThousandsOfNamesFewAreLogged) {
  runtime::ExceptionLog exceptions;
  const auto flood = [&](const std::string& word) {
    for (int i = 0; i < 5000; ++i) {
      exceptions.note(runtime::Ended::request, word + std::to_string(i),
                      std::make_exception_ptr(std::runtime_error{"no"}), clock.steady_us());
    }
  };
  flood("first ");
  EXPECT_LE(log.lines_with("first "), 33U);
  EXPECT_EQ(exceptions.count(runtime::Ended::request), 5000U);
  clock.run_for(1s);
  flood("second ");
  EXPECT_GE(log.lines_with("second "), 2U) << "those of before have made room";
  EXPECT_LE(log.lines_with("second "), 33U);
}

TEST_F(SessionExceptionTest, ThatTheStationStopsIsNone) {
  connect();
  tasks.stop();
  clock.settle();
  EXPECT_EQ(counted(), 0U);
  EXPECT_EQ(tasks.exit_code(), 0);
}

}  // namespace
}  // namespace server
