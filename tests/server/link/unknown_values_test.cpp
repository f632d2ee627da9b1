// What a newer firmware says and this version does not know stays what it is: its text is "unknown", its number is
// kept.
#include "server/station/state/unknown_values.hpp"

#include "server/live/state_json.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

using nlohmann::json;

TEST(UnknownValues, NameTheFieldsWhoseEnumeratorsAreNotKnown) {
  station::SampleContext context;
  EXPECT_EQ(unknown_values(context), std::nullopt);
  context.mode = static_cast<protocol::Mode>(17);
  context.sub_state = rheonaut_SUB_STATE_HOLDING;
  EXPECT_EQ(unknown_values(context), R"({"mode":17})");
  context.emergency_cause = static_cast<protocol::EmergencyCause>(0x7fffffff);
  EXPECT_EQ(unknown_values(context), R"({"mode":17,"emergency_cause":2147483647})");
  context.mode = static_cast<protocol::Mode>(station::kNumberNotKept);
  EXPECT_STREQ(protocol::text(context.mode), "unknown");
  EXPECT_EQ(unknown_values(context), R"({"emergency_cause":2147483647})");
  EXPECT_EQ(station::UnknownValues{}.add("reset_cause", rheonaut_RESET_CAUSE_UNKNOWN).text(), std::nullopt)
      << "it is known";
  EXPECT_EQ(station::UnknownValues{}.add("reset_cause", static_cast<protocol::ResetCause>(9)).text(),
            R"({"reset_cause":9})");
}

TEST(UnknownValues, AReasonKeepsItsNumberInTheText) {
  EXPECT_EQ(station::text_or_number(rheonaut_REJECT_REASON_BUSY), "busy");
  EXPECT_EQ(station::text_or_number(static_cast<protocol::RejectReason>(40)), "unknown_40");
}

// A newer robot, from its hello on, in every message of /live and in GET /robots.
TEST_F(LinkTest, ANewerFirmwaresValuesAreUnknownWithTheirNumbers) {
  auto* robot = dial();
  auto hello = TestRobot::hello_frame(static_cast<protocol::Mode>(17));
  hello.body.hello.reset_cause = static_cast<protocol::ResetCause>(9);
  robot->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  const json state = live::to_json(*station.find("r1"));
  EXPECT_EQ(state["mode"], "unknown");
  EXPECT_EQ(state["reset_cause"], "unknown");
  EXPECT_EQ(state["unknown_values"], (json{{"mode", 17}, {"reset_cause", 9}}));
  EXPECT_EQ(live::to_json(sink.events.back())["unknown_values"], (json{{"mode", 17}})) << "of the station's own event";

  auto frame = TestRobot::samples_frame(0, 5, 6'000'000, 0);
  frame.body.telemetry.mode = rheonaut_MODE_AUTO;
  frame.body.telemetry.sub_state = static_cast<protocol::SubState>(5);
  robot->send(frame);
  clock.settle();
  ASSERT_EQ(sink.batches.size(), 1u);
  const json samples = json::parse(live::samples_message(sink.batches[0]));
  EXPECT_EQ(samples["mode"], "auto");
  EXPECT_EQ(samples["sub_state"], "unknown");
  EXPECT_EQ(samples["unknown_values"], (json{{"sub_state", 5}}));

  frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_event_tag;
  frame.body.event.kind = static_cast<protocol::EventKind>(90);
  frame.body.event.cause = static_cast<protocol::EventCause>(91);
  frame.body.event.mode = rheonaut_MODE_AUTO;
  frame.body.event.emergency_cause = static_cast<protocol::EmergencyCause>(92);
  robot->send(frame);
  clock.settle();
  const json event = live::to_json(sink.events.back());
  EXPECT_EQ(event["kind"], "unknown");
  EXPECT_EQ(event["cause"], "unknown");
  EXPECT_EQ(event["emergency_cause"], "unknown");
  EXPECT_EQ(event["unknown_values"], (json{{"cause", 91}, {"emergency_cause", 92}, {"kind", 90}}));
}

}  // namespace
}  // namespace server
