// What an event says by itself: its own cause, that of the latch beside it, and words of the station in a place of
// theirs.
#include "server/live/state_json.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

protocol::RobotFrame event_frame(protocol::EventKind kind, protocol::EventCause cause,
                                 protocol::EmergencyCause of_latch) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_event_tag;
  frame.body.event.kind = kind;
  frame.body.event.cause = cause;
  frame.body.event.mode = rheonaut_MODE_EMERGENCY;
  frame.body.event.emergency_id = 9;
  frame.body.event.emergency_cause = of_latch;
  return frame;
}

TEST_F(LinkTest, AnEventOfALatchedRobotKeepsItsOwnCause) {
  auto* robot = connect();
  robot->send(
      event_frame(rheonaut_EVENT_KIND_LINK_LOST, rheonaut_EVENT_CAUSE_LINK_LOSS, rheonaut_EMERGENCY_CAUSE_OPERATOR));
  clock.settle();
  const station::RobotEvent& event = sink.events.back();
  EXPECT_EQ(event.kind, "link_lost");
  EXPECT_EQ(event.cause, "link_loss");
  EXPECT_EQ(event.emergency_cause, rheonaut_EMERGENCY_CAUSE_OPERATOR);
  EXPECT_EQ(event.detail, "");
  const nlohmann::json said = live::to_json(event);
  EXPECT_EQ(said["cause"], "link_loss");
  EXPECT_EQ(said["emergency_cause"], "operator");
  EXPECT_EQ(said["detail"], "");
}

TEST_F(LinkTest, AnEventWithoutALatchSaysThatThereIsNone) {
  auto* robot = connect();
  robot->send(event_frame(rheonaut_EVENT_KIND_TIME_STEP, rheonaut_EVENT_CAUSE_TIME, rheonaut_EMERGENCY_CAUSE_NONE));
  clock.settle();
  EXPECT_EQ(live::to_json(sink.events.back())["cause"], "time");
  EXPECT_EQ(live::to_json(sink.events.back())["emergency_cause"], "none");
}

TEST_F(LinkTest, TheStationsOwnEventsSayTheLatchAndPutTheirWordsIntoTheDetail) {
  auto* robot = dial();
  auto hello = TestRobot::hello_frame(rheonaut_MODE_EMERGENCY);
  hello.body.hello.emergency_id = 9;
  hello.body.hello.emergency_cause = rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK;
  robot->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  const station::RobotEvent& event = sink.events.back();
  EXPECT_EQ(event.kind, "connected");
  EXPECT_EQ(event.cause, "none");
  EXPECT_EQ(event.detail, "from " + station.find("r1")->peer);
  EXPECT_EQ(event.emergency_cause, rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK);
  EXPECT_EQ(event.emergency_id, 9u);
}

TEST_F(LinkTest, ARefusalNamesItsReasonAsTheCause) {
  connect();
  archive.answer.refusal = rheonaut_REFUSAL_REASON_WRONG_TOKEN;
  auto* impostor = dial();
  impostor->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return impostor->closed; }, 1s));
  EXPECT_EQ(sink.events.back().kind, "connection_refused");
  EXPECT_EQ(sink.events.back().cause, "wrong_token");
}

}  // namespace
}  // namespace server
