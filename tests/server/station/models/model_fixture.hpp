// A station with a model sender, and a hand-made robot that keeps parameters as the firmware does.
#pragma once

#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "server/station/models/model_exchange.hpp"
#include "server/station/models/model_sender.hpp"
#include "tests/server/link/link_fixture.hpp"
#include "tests/server/station/models/reported_parameters.hpp"

namespace server {

// Keeps parameters as the firmware does, and tells of them; its word is in `held`.
class ModelSenderFixture : public LinkTest {
 protected:
  ModelSenderFixture() {
    for (const auto& [name, value] : parameters_of(station::FluidModel{})) held[name] = value;
    held["model_confirmed"] = 0;
    models.put("water", some_model());
    tasks.spawn("control", station.watch_control());
  }
  ~ModelSenderFixture() override {  // before the sender goes
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
  void send_own(const station::FluidModel& own, const std::string& actor = "token:local") {
    ASSERT_TRUE(station.send_model("r1", station.find("r1")->fluid, own, {actor, "", clock.utc_us()}));
  }
  const station::RobotModel& model() const { return station.find("r1")->model; }
  std::vector<std::string> events() const {
    std::vector<std::string> kinds;
    for (const station::RobotEvent& event : sink.events) {
      if (event.kind.starts_with("model_")) kinds.push_back(event.kind);
    }
    return kinds;
  }
  std::string latest_detail() const {
    std::string detail;
    for (const station::RobotEvent& event : sink.events) {
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

  station::FluidModelList models;
  station::ModelSender sender{loop, tasks, clock, station, models};
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

}  // namespace server
