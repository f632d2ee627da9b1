// A robot that connects again and again: a bounded number of its connections is recorded, each with its end, and of the
// others their exact count. What is shown live is always true.
#include <fmt/format.h>

#include "server/station/state/event_allowance.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

class ConnectionFloodTest : public LinkTest {
 protected:
  static constexpr auto kBurst = static_cast<std::size_t>(station::ConnectionAllowance::kBurst);

  ConnectionFloodTest() { tasks.spawn("control", station.watch_control()); }

  TestRobot* greet() {
    auto* robot = dial();
    robot->say_hello();
    EXPECT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
    return robot;
  }
  void reconnect(std::size_t times) {
    for (std::size_t n = 0; n < times; ++n) {
      auto* robot = greet();
      ASSERT_TRUE(connected());
      robot->link.cut();
      ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 1s));
    }
  }
  std::size_t recorded(const std::string& kind) const {
    return static_cast<std::size_t>(std::ranges::count(sink.events, kind, &station::RobotEvent::kind));
  }
  std::string left_out() const {
    const auto said = std::ranges::find(sink.events, "connections_left_out", &station::RobotEvent::kind);
    return said == sink.events.end() ? "" : said->detail;
  }
};

TEST_F(ConnectionFloodTest, OfThreeHundredInALoopABoundedNumberIsRecordedAndTheRestIsCounted) {
  reconnect(300);
  EXPECT_EQ(recorded("connected"), kBurst);
  EXPECT_EQ(recorded("disconnected"), kBurst);
  EXPECT_EQ(sink.events.size(), 2 * kBurst) << "and nothing else";
  clock.run_for(30s);
  ASSERT_EQ(recorded("connections_left_out"), 1u);
  EXPECT_TRUE(left_out().starts_with(fmt::format("{} from ", 300 - kBurst))) << left_out();
  EXPECT_EQ(sink.events.back().cause, "too_many");
}

TEST_F(ConnectionFloodTest, TheConnectionThatStaysIsRecordedAsSoonAsOneMayBe) {
  reconnect(100);
  auto* robot = connect();
  EXPECT_TRUE(connected());
  EXPECT_EQ(recorded("connected"), kBurst);
  clock.run_for(3s);
  ASSERT_EQ(recorded("connected"), kBurst + 1);
  EXPECT_EQ(sink.events.back().kind, "connected") << "the record ends with what is";
  robot->link.cut();
  ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 1s));
  EXPECT_EQ(recorded("disconnected"), kBurst + 1);
  clock.run_for(11s);
  EXPECT_TRUE(left_out().starts_with(fmt::format("{} from ", 100 - kBurst))) << left_out();
}

TEST_F(ConnectionFloodTest, OneThatTakesThePlaceOfAnotherCountsAsWell) {
  for (int n = 0; n < 80; ++n) greet();
  EXPECT_EQ(recorded("connected"), kBurst);
  EXPECT_EQ(recorded("connection_replaced"), kBurst);
  EXPECT_TRUE(connected());
  tasks.stop();
  clock.settle();
  EXPECT_TRUE(left_out().starts_with(fmt::format("{} from ", 79 - kBurst))) << left_out() << ": at once at the end";
  EXPECT_EQ(recorded("connected"), kBurst + 1) << "and the one that is";
  EXPECT_EQ(sink.events.back().kind, "disconnected");
}

TEST_F(ConnectionFloodTest, ANewBootEachTimeIsBoundedToo) {
  for (station::BootId boot_id = 1000; boot_id < 1200; ++boot_id) {
    auto* robot = dial();
    protocol::RobotFrame hello = TestRobot::hello_frame();
    hello.body.hello.boot_id = boot_id;
    robot->send(hello);
    ASSERT_TRUE(clock.run_until([&] { return connected(); }, 1s));
    EXPECT_EQ(station.find("r1")->boot_id, boot_id);
    robot->link.cut();
    ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 1s));
  }
  EXPECT_EQ(sink.events.size(), 2 * kBurst);
}

TEST_F(ConnectionFloodTest, AConnectionEachTwoSecondsForTenMinutesIsNoFlood) {
  for (int n = 0; n < 300; ++n) {
    reconnect(1);
    clock.run_for(2s);
  }
  EXPECT_EQ(recorded("connected"), 300u);
  EXPECT_EQ(recorded("disconnected"), 300u);
  EXPECT_EQ(left_out(), "");
}

}  // namespace
}  // namespace server
