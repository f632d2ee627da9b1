// Commands that wait on a real robot core for their time, and what the station says of their ends.
#include "tests/server/link/test_robot.hpp"
#include "tests/system/station_fixture.hpp"

namespace server {
namespace {

class TimedCommandsTest : public SystemTest {
 protected:
  TimedCommandsTest() { station.add_sink(sink); }
  ~TimedCommandsTest() override {
    tasks.stop();
    clock.settle();
  }

  std::uint64_t in_ms(std::uint64_t ms) const { return state().latest_robot_time_us + ms * 1000; }
  // It is answered within 0.1 s, unless the link is stalled.
  station::CommandId order(const protocol::Command& action) {
    station::CommandRequest request;
    request.robot_id = "sim-1";
    request.action = action;
    request.actor = "test";
    request.time_to_live = 8s;
    tasks.spawn("order", submit_and_forget(std::move(request)));
    clock.settle();
    return sink.commands.back().id;
  }
  std::string end_of(station::CommandId id) const {
    const auto& record =
        *std::ranges::find(sink.commands.rbegin(), sink.commands.rend(), id, &station::CommandRecord::id);
    return std::string{text(record.state)} + (record.reason.empty() ? "" : " " + record.reason);
  }

  RecordingSink sink;

 private:
  boost::asio::awaitable<void> submit_and_forget(station::CommandRequest request) {
    const auto result = co_await station.submit(std::move(request));
    EXPECT_TRUE(result);
  }
};

// Four that wait and all that was on its way are acknowledged together.
TEST_F(TimedCommandsTest, AllEndAsTheRobotSaysWhenItDropsThemAfterAStall) {
  begin();
  std::vector<station::CommandId> waiting, pings;
  for (int i = 0; i < 4; ++i) {
    waiting.push_back(order(sim_robot::timed(sim_robot::set_duty(0.25F), in_ms(5000))));
    pass(0.1);
    EXPECT_EQ(end_of(waiting.back()), "acknowledged");
  }
  robot->stall(true);
  order(sim_robot::set_duty(0));
  for (int i = 0; i < 5; ++i) pings.push_back(order(sim_robot::ping()));
  pass(0.3);
  robot->stall(false);
  pass(0.5);
  for (const station::CommandId id : waiting) EXPECT_EQ(end_of(id), "expired expired");
  for (const station::CommandId id : pings) EXPECT_EQ(end_of(id), "acknowledged");
}

TEST_F(TimedCommandsTest, OneThatALostLinkDropsIsExpiredInTheRecord) {
  begin();
  const station::CommandId waiting = order(sim_robot::timed(sim_robot::set_duty(0.25F), in_ms(5000)));
  pass(0.1);
  robot->cut();
  pass(0.1);
  EXPECT_EQ(end_of(waiting), "unknown link_lost");
  pass(2);
  EXPECT_EQ(end_of(waiting).substr(0, 7), "expired") << end_of(waiting);
}

}  // namespace
}  // namespace server
