// What is sent to a robot of its fluid: which commands, in which order, and what becomes of it when something goes
// wrong.
// LONG: the hand-made robot that keeps parameters, and a test for each way in which a confirmation could outlive its
// fluid.
#include "server/station/model_sender.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <map>

#include "tests/server/captured_log.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

FluidModel some_model(float first_gain = 0.25F) {
  FluidModel model;
  model.gain_m_s = {first_gain, -0.5F, 0.1F, 0};
  model.time_constant_s = {0.1F, 1, 5, 15};
  model.fit_error = 0.002;
  model.set_by = "token:local";
  model.set_at_us = 1'700'000'000'000'000;
  return model;
}

// A sink that fails once, as nothing in the station should.
class FailsOnce final : public StationSink {
 public:
  void on_command(const CommandRecord& record) override {
    if (record.state == CommandState::queued && std::exchange(at_command, false)) fail();
  }
  void on_robot(const RobotState& robot) override {
    if (robot.model.state == ModelState::confirmed && std::exchange(at_confirmed, false)) fail();
  }
  bool at_command = false, at_confirmed = false;

 private:
  static void fail() { throw std::runtime_error{"no room for it"}; }
};

// Keeps parameters as the firmware does, and tells of them; its word is in `held`.
class ModelSenderTest : public LinkTest {
 protected:
  ModelSenderTest() {
    for (const auto& [name, value] : parameters_of(FluidModel{})) held[name] = value;
    held["model_confirmed"] = 0;
    models.put("water", some_model());
    tasks.spawn("control", station.watch_control());
  }
  ~ModelSenderTest() override {  // before the sender goes
    tasks.stop();
    clock.settle();
  }

  void begin(std::uint64_t boot_id = 77, std::uint64_t next_seq = 0) {
    const std::int64_t booted_at_us = robot != nullptr && boot_id == 77 ? robot->booted_at_us : 0;
    robot = dial();
    if (booted_at_us != 0) robot->booted_at_us = booted_at_us;
    auto hello = TestRobot::hello_frame();
    hello.body.hello.boot_id = boot_id;
    hello.body.hello.next_seq = next_seq;
    robot->send(hello);
    ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
    seq = next_seq;
    answered = 0;
    for (const auto& [name, value] : held) say(name, value);
    live(100ms);
  }

  void say(const std::string& name, float value) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
    auto& page = frame.body.parameter_page;
    page.total = static_cast<std::uint32_t>(held.size());
    page.parameters_count = 1;
    std::strncpy(page.parameters[0].name, name.c_str(), sizeof page.parameters[0].name - 1);
    page.parameters[0].value = value;
    robot->send(frame);
  }

  // The robot answers and sends samples for so long.
  void live(microseconds duration) {
    for (std::int64_t end_us = clock.steady_us() + duration.count(); clock.steady_us() < end_us;) {
      clock.run_for(50ms);
      const auto commands = robot->commands();
      for (; answered < commands.size(); ++answered) answer(commands[answered]);
      auto frame = TestRobot::samples_frame(seq, 5, robot->robot_now_us(), 0);
      frame.body.telemetry.mode = mode;
      frame.body.telemetry.flags = held["model_confirmed"] == 1 && !hides_flag ? 64 : 0;
      for (float& each : frame.body.telemetry.duty) each = duty;
      robot->send(frame);
      seq += 5;
    }
  }

  void answer(const protocol::Command& command) {
    if (command.which_action != rheonaut_Command_set_parameter_tag) return;
    const std::string name = command.action.set_parameter.name;
    const bool is_on = duty != 0 || is_coasting;
    if (is_on) {
      ++refused;
      return robot->acknowledge(command, rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_MOTOR_ON);
    }
    sent.push_back(name);
    held[name] = bends.contains(name) ? bends[name] : command.action.set_parameter.value;
    if (name != "model_confirmed") held["model_confirmed"] = 0;
    if (name == "model_confirmed" && breaks_after_confirming) return robot->link.cut();
    robot->acknowledge(command, rheonaut_COMMAND_RESULT_ACCEPTED);
    say(name, held[name]);
  }

  // By somebody's command.
  void change(const std::string& name, float value) {
    held[name] = value;
    held["model_confirmed"] = 0;
    say(name, value);
  }

  // In the same boot, after the link was cut.
  void come_back() {
    robot->link.cut();
    clock.run_for(1s);
    ASSERT_FALSE(connected());
    begin(77, seq);
  }

  void name_fluid(const std::string& fluid, const std::string& actor = "token:local") {
    ASSERT_TRUE(station.set_fluid("r1", fluid, {actor, "", clock.utc_us()}));
  }
  const RobotModel& model() const { return station.find("r1")->model; }
  std::vector<std::string> events() const {
    std::vector<std::string> kinds;
    for (const RobotEvent& event : sink.events) {
      if (event.kind.starts_with("model_")) kinds.push_back(event.kind);
    }
    return kinds;
  }
  std::string latest_detail() const {
    std::string detail;
    for (const RobotEvent& event : sink.events) {
      if (event.kind.starts_with("model_")) detail = event.detail;
    }
    return detail;
  }
  bool holds_water() const {
    for (const auto& [name, value] : parameters_of(some_model())) {
      if (held.at(name) != value) return false;
    }
    return true;
  }

  FluidModelList models;
  ModelSender sender{loop, tasks, clock, station, models};
  TestRobot* robot = nullptr;
  std::map<std::string, float> held;
  std::map<std::string, float> bends;  // what the robot makes of whatever it is sent
  std::vector<std::string> sent;       // and taken
  int refused = 0;
  protocol::Mode mode = rheonaut_MODE_MANUAL;
  float duty = 0;
  bool is_coasting = false, hides_flag = false, breaks_after_confirming = false;
  std::uint64_t seq = 0;
  std::size_t answered = 0;
};

TEST_F(ModelSenderTest, WhatTheRobotDoesNotHoldYetIsSentAndThenConfirmed) {
  held["model_time_constant_2_s"] = 1;
  begin();
  EXPECT_EQ(model(), RobotModel{});
  name_fluid("water");
  EXPECT_EQ(model().state, ModelState::sending);
  EXPECT_EQ(model().fluid, "water");
  live(5s);
  EXPECT_THAT(sent, ElementsAre("model_gain_1_m_s", "model_gain_2_m_s", "model_gain_3_m_s", "model_time_constant_1_s",
                                "model_time_constant_3_s", "model_time_constant_4_s", "model_confirmed"));
  EXPECT_TRUE(holds_water());
  EXPECT_EQ(model().state, ModelState::confirmed) << model().reason;
  EXPECT_EQ(model().fluid, "water");
  EXPECT_EQ(model().fit_error, 0.002);
  EXPECT_EQ(model().set_at_us, some_model().set_at_us);
  EXPECT_THAT(events(), ElementsAre("model_confirmed"));
  EXPECT_EQ(sink.commands.back().actor, "token:local") << "on behalf of the actor that named the fluid";

  name_fluid("water");
  live(1s);
  EXPECT_EQ(sent.size(), 7U) << "it is confirmed already";
}

TEST_F(ModelSenderTest, OfParametersThatHoldOnlyTheConfirmationIsSent) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  begin();
  name_fluid("water");
  live(2s);
  EXPECT_THAT(sent, ElementsAre("model_confirmed"));
  EXPECT_EQ(model().state, ModelState::confirmed);
}

// SAFETY's test: what is read back, and not what was sent, is confirmed.
TEST_F(ModelSenderTest, AValueThatComesBackOtherwiseIsNeverConfirmed) {
  bends["model_gain_2_m_s"] = std::nextafter(-0.5F, 0.0F);
  begin();
  name_fluid("water");
  live(10s);
  EXPECT_THAT(sent, Not(Contains("model_confirmed")));
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("model_gain_2_m_s = -0.5 was sent, and the robot holds -0.49999997"));
  EXPECT_THAT(events(), ElementsAre("model_not_confirmed"));
  EXPECT_THAT(latest_detail(), HasSubstr("the model of 'water' could not be sent"));
}

TEST_F(ModelSenderTest, WhatTelemetryDoesNotShowIsNotConfirmed) {
  hides_flag = true;
  begin();
  name_fluid("water");
  live(8s);
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("telemetry does not show it"));
}

TEST_F(ModelSenderTest, ARobotThatMovesIsWaitedForAndThenGivenUp) {
  begin();
  mode = rheonaut_MODE_AUTO;
  duty = 0.5F;
  live(200ms);
  name_fluid("water");
  live(10s);
  EXPECT_EQ(model().state, ModelState::sending);
  EXPECT_EQ(refused, 0) << "nothing is sent to a robot that is seen to move";
  mode = rheonaut_MODE_MANUAL;
  duty = 0;
  is_coasting = true;
  live(3s);
  EXPECT_GT(refused, 0);
  is_coasting = false;
  live(5s);
  EXPECT_EQ(model().state, ModelState::confirmed);

  models.put("water", some_model(0.5F));
  duty = 0.1F;
  live(200ms);
  name_fluid("water");
  live(ModelSender::kPatience + 1s);
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("the motor is on"));
  duty = 0;
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0) << "the model that it holds is no longer that of the fluid";
}

// SAFETY's test: a confirmation does not outlive the fluid that it was made for.
TEST_F(ModelSenderTest, AFluidWithoutAModelOrNoneTakesTheConfirmationBack) {
  begin();
  for (const char* next : {"non_newtonian", ""}) {
    name_fluid("water");
    live(5s);
    ASSERT_EQ(held["model_confirmed"], 1);
    name_fluid(next);
    live(2s);
    EXPECT_EQ(held["model_confirmed"], 0);
    EXPECT_EQ(model().state, ModelState::assumed);
    EXPECT_EQ(events().back(), "model_taken_back");
  }
  const std::size_t before = sent.size();
  name_fluid("non_newtonian");
  live(2s);
  EXPECT_EQ(sent.size(), before) << "there is nothing to take back";
  EXPECT_EQ(model().reason, "there is no model of 'non_newtonian'");
}

TEST_F(ModelSenderTest, WhatCouldNotBeTakenBackWhileTheRobotMovedIsTakenBackAtRest) {
  begin();
  name_fluid("water");
  live(5s);
  duty = 0.5F;
  live(200ms);
  name_fluid("non_newtonian");
  live(ModelSender::kPatience + 20s);
  EXPECT_EQ(model().state, ModelState::failed);
  is_coasting = true;  // and says so
  duty = 0;
  live(2 * (ModelSender::kPatience + ModelSender::kRetryInterval) + 5s);
  EXPECT_EQ(held["model_confirmed"], 1);
  const auto kinds = events();
  EXPECT_EQ(std::count(kinds.begin(), kinds.end(), "model_not_taken_back"), 2) << "a retry is no news";
  EXPECT_THAT(latest_detail(), HasSubstr("is not taken back yet: the motor is on, or the robot coasts"));
  is_coasting = false;
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, ModelState::assumed);
}

TEST_F(ModelSenderTest, WhatWasNamedWhileTheRobotWasAwayIsTakenBackWhenItReturns) {
  begin();
  name_fluid("water");
  live(5s);
  robot->link.cut();
  clock.run_for(1s);
  ASSERT_FALSE(connected());
  name_fluid("non_newtonian");
  begin(77, seq);
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, ModelState::assumed);
}

// SAFETY's test: the robot had taken the confirmation when the link broke, and nobody has seen it.
TEST_F(ModelSenderTest, AConfirmationThatWasOnItsWayWhenTheLinkBrokeIsTakenBack) {
  breaks_after_confirming = true;
  begin();
  name_fluid("water");
  live(3s);
  ASSERT_FALSE(connected());
  ASSERT_EQ(held["model_confirmed"], 1);
  EXPECT_EQ(model().state, ModelState::failed);
  name_fluid("non_newtonian");
  clock.run_for(3s);
  breaks_after_confirming = false;
  begin(77, seq);
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, ModelState::assumed);
}

TEST_F(ModelSenderTest, ARobotThatIsAwayIsNotSentAModelLater) {
  begin();
  robot->link.cut();
  clock.run_for(1s);
  name_fluid("water");
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_EQ(model().reason, "the robot was not connected; name the fluid again");
  begin(77, seq);
  live(5s);
  EXPECT_THAT(sent, IsEmpty());
}

TEST_F(ModelSenderTest, AfterABootTheModelIsAssumedUntilTheFluidIsNamedAgain) {
  begin();
  name_fluid("water");
  live(5s);
  ASSERT_EQ(model().state, ModelState::confirmed);
  robot->link.cut();
  clock.run_for(1s);
  EXPECT_EQ(model().state, ModelState::confirmed) << "it may be back in the same boot";
  held["model_confirmed"] = 0;
  begin(78);
  live(2s);
  EXPECT_EQ(model().state, ModelState::assumed);
  EXPECT_EQ(model().reason, "the robot has booted: name its fluid again");
  const std::size_t before = sent.size();
  live(5s);
  EXPECT_EQ(sent.size(), before);
  name_fluid("water");
  live(2s);
  EXPECT_EQ(sent.back(), "model_confirmed");
  EXPECT_EQ(model().state, ModelState::confirmed);
}

TEST_F(ModelSenderTest, TheFluidThatIsNamedLastCounts) {
  models.put("non_newtonian", some_model(0.75F));
  begin();
  name_fluid("water");
  live(250ms);
  ASSERT_FALSE(sent.empty());
  name_fluid("non_newtonian");
  live(5s);
  EXPECT_EQ(model().fluid, "non_newtonian");
  EXPECT_EQ(model().state, ModelState::confirmed);
  EXPECT_EQ(held["model_gain_1_m_s"], 0.75F);
  EXPECT_THAT(events(), ElementsAre("model_confirmed"));
}

TEST_F(ModelSenderTest, WhoIsNotInControlSendsNothing) {
  begin();
  ASSERT_TRUE(station.control({"r1", "session:1", "", ControlAction::take, 60s, ""}));
  EXPECT_FALSE(station.set_fluid("r1", "water", {"session:2", "", 0}));
  live(2s);
  name_fluid("water", "session:1");
  live(250ms);
  const std::size_t before = sent.size();
  ASSERT_GT(before, 0U);
  ASSERT_TRUE(station.control({"r1", "session:3", "", ControlAction::force, 60s, "a test"}));
  live(5s);
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("controlled by session:3"));
  ASSERT_TRUE(station.control({"r1", "session:3", "", ControlAction::take, 60s, ""}));
  const RobotModel now = model();
  ASSERT_TRUE(station.set_fluid("r1", "water", {"session:2", "", 0})) << "no change";
  live(2s);
  EXPECT_EQ(model(), now);
}

TEST_F(ModelSenderTest, WhatTheRobotTakesBackByItselfIsAssumed) {
  begin();
  name_fluid("water");
  live(5s);
  held["model_gain_1_m_s"] = 1;  // by somebody's command
  held["model_confirmed"] = 0;
  say("model_gain_1_m_s", 1);
  live(1s);
  EXPECT_EQ(model().state, ModelState::assumed);
  EXPECT_THAT(model().reason, HasSubstr("a parameter was changed"));
  held["model_confirmed"] = 1;  // likewise
  live(1s);
  EXPECT_EQ(model().state, ModelState::confirmed);
  EXPECT_EQ(model().fluid, "") << "of no fluid that the station knows";
}

TEST_F(ModelSenderTest, TakesNoControlForTheActorThatNamedTheFluid) {
  begin();
  is_coasting = true;
  name_fluid("water", "user:anna");
  live(3s);
  EXPECT_GT(refused, 0);
  EXPECT_EQ(station.find("r1")->control.holder, "");
  is_coasting = false;
  live(5s);
  EXPECT_EQ(model().state, ModelState::confirmed);
  EXPECT_EQ(station.find("r1")->control.holder, "");
}

TEST_F(ModelSenderTest, OtherBitsUnderAFlagThatNoSampleShowedFallingAreNoLongerTheFluidsModel) {
  begin();
  name_fluid("water");
  live(3s);
  ASSERT_EQ(model(), (RobotModel{ModelState::confirmed, "water", "", 0.002, some_model().set_at_us}));
  held["model_gain_1_m_s"] = 0.3F;  // and confirmed again, before the next sample
  say("model_gain_1_m_s", 0.3F);
  live(500ms);
  EXPECT_NE(model().fluid, "water");
}

// A page comes before the sample that shows what the change has done to the confirmation.
TEST_F(ModelSenderTest, AChangedParameterIsNoConfirmationBySomebodyElse) {
  begin();
  name_fluid("water");
  live(3s);
  change("model_gain_3_m_s", 0.3F);
  clock.settle();
  EXPECT_EQ(model().state, ModelState::assumed) << "the link may break now";
  live(2s);
  EXPECT_EQ(model().state, ModelState::assumed);
  EXPECT_THAT(model().reason, HasSubstr("a parameter was changed"));
  const auto is_of_no_fluid = [](const RobotState& one) {
    return one.model.state == ModelState::confirmed && one.model.fluid.empty();
  };
  EXPECT_EQ(std::count_if(sink.robots.begin(), sink.robots.end(), is_of_no_fluid), 0);
}

TEST_F(ModelSenderTest, AParameterThatIsChangedAfterTheLinkReturnedEndsTheConfirmation) {
  begin();
  name_fluid("water");
  live(3s);
  come_back();
  EXPECT_EQ(model().fluid, "water");
  change("model_gain_1_m_s", 0.3F);
  live(2s);
  EXPECT_EQ(model().state, ModelState::assumed);
  EXPECT_EQ(model().fluid, "");
}

// SAFETY's test: the same, and confirmed again while the link was cut. Nothing is sent while another is in control.
TEST_F(ModelSenderTest, OtherBitsOfARobotThatReturnsConfirmedAreNotTheFluidsModel) {
  begin();
  name_fluid("water");
  live(3s);
  ASSERT_TRUE(station.control({"r1", "session:1", "", ControlAction::take, 20s, ""}));
  held["model_gain_1_m_s"] = 0.3F;
  come_back();
  live(2s);
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_EQ(model().reason, "what was confirmed before is not taken back yet");
  EXPECT_EQ(held["model_confirmed"], 1);
  live(30s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, ModelState::assumed);
}

// SAFETY's test: while the sender waits for rest, somebody else may change what it has sent.
TEST_F(ModelSenderTest, WhatIsChangedWhileTheConfirmationWaitsIsNotConfirmed) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  begin();
  is_coasting = true;
  name_fluid("water");
  live(300ms);
  ASSERT_EQ(refused, 1) << "the confirmation";
  is_coasting = false;
  change("model_gain_1_m_s", 0.3F);
  live(5s);
  EXPECT_THAT(sent, Not(Contains("model_confirmed")));
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_THAT(model().reason, HasSubstr("somebody else changed one"));
}

// SAFETY's test: no sample shows the flag falling.
TEST_F(ModelSenderTest, OtherBitsUnderAConfirmationThatTheStationOnlyJudgedAreTakenBack) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  begin();
  live(2s);
  ASSERT_EQ(model().fluid, "water");
  held["model_gain_1_m_s"] = 0.3F;
  say("model_gain_1_m_s", 0.3F);
  live(500ms);
  EXPECT_EQ(model().fluid, "");
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(model().state, ModelState::assumed);
}

TEST_F(ModelSenderTest, AfterARestartOfTheStationAConfirmationStandsForTheModelOfTheNamedFluidAlone) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  begin();
  live(2s);
  EXPECT_EQ(model().state, ModelState::confirmed);
  EXPECT_EQ(model().fluid, "water");
  EXPECT_THAT(sent, IsEmpty());
}

// SAFETY's test: nobody knows for which fluid it was made.
TEST_F(ModelSenderTest, AConfirmationThatTheStationHasNotSeenBeingMadeIsTakenBack) {
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  begin();
  ASSERT_TRUE(station.control({"r1", "session:1", "", ControlAction::take, 10s, ""}));
  live(5s);
  EXPECT_EQ(held["model_confirmed"], 1) << "while somebody is in control nothing is sent";
  live(10s);
  EXPECT_EQ(held["model_confirmed"], 0);
  EXPECT_EQ(sink.commands.back().actor, "station:model");
  EXPECT_EQ(model().state, ModelState::assumed);
}

class FailingModelTest : public ModelSenderTest {
 protected:
  FailingModelTest() { station.add_sink(failing); }
  void expect_contained() {
    EXPECT_EQ(tasks.exceptions().count(Ended::model), 1U);
    EXPECT_TRUE(log.has("the model of robot 'r1': no room for it")) << log.text();
    EXPECT_EQ(tasks.exit_code(), 0);
    EXPECT_FALSE(tasks.stopping());
  }

  CapturedLog log;
  FailsOnce failing;
};

TEST_F(FailingModelTest, AFaultWhileTheModelIsSentFailsThatModelAlone) {
  begin();
  failing.at_command = true;
  name_fluid("water");
  live(1s);
  expect_contained();
  EXPECT_EQ(model().state, ModelState::failed);
  EXPECT_EQ(model().reason, "a fault of the station; its log says which");
  EXPECT_THAT(events(), ElementsAre("model_not_confirmed"));
  name_fluid("water");
  live(5s);
  EXPECT_EQ(model().state, ModelState::confirmed) << model().reason;
}

TEST_F(FailingModelTest, AFaultAtItsEndStopsNothing) {
  begin();
  failing.at_confirmed = true;
  name_fluid("water");
  live(5s);
  expect_contained();
  name_fluid("");
  live(5s);
  EXPECT_EQ(model().state, ModelState::assumed) << "it goes on with the next fluid";
}

TEST_F(FailingModelTest, AFaultWhileWhatTheRobotReportsIsFollowedStopsNothing) {
  for (const auto& [name, value] : parameters_of(some_model())) held[name] = value;
  held["model_confirmed"] = 1;
  station.restore({{.id = "r1", .boot_id = 77, .fluid = "water"}}, {});
  failing.at_confirmed = true;
  begin();
  live(2s);
  expect_contained();
  held["model_confirmed"] = 0;
  live(1s);
  EXPECT_EQ(model().state, ModelState::assumed) << "it goes on to follow";
}

}  // namespace
}  // namespace server
