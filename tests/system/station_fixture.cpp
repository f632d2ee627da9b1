// Wires the station for tests as main.cpp wires it for people.
#include "tests/system/station_fixture.hpp"

#include <unistd.h>

namespace server {

SystemTest::SystemTest() {
  std::string name = (std::filesystem::temp_directory_path() / "rheonaut-system-XXXXXX").string();
  folder = mkdtemp(name.data());
  clock.add_worker(disk);
  clock.add_worker(readers);
  recording = std::make_unique<RecordingParts>(loop, clock, disk, readers, RecorderOptions{folder / "station.sqlite"});
  recorder = &recording->recorder;
  runs = &recording->runs;
  history = &recording->history;
  recording->connect(station);
  run_first(loop, recording->open());
  recording->spawn(tasks);
  const boost::asio::ip::tcp::endpoint any_port{boost::asio::ip::address_v4::loopback(), 0};
  listener = std::make_unique<RobotListener>(loop, clock, tasks, station, *recorder, any_port, false);
}

SystemTest::~SystemTest() {
  tasks.stop();
  clock.settle();
  recording->close();
  std::filesystem::remove_all(folder);
}

void SystemTest::add_robot(sim_robot::SimulatedRobotConfig config) {
  robot = std::make_unique<VirtualRobot>(loop, clock, tasks, std::move(config));
  robot->dial(*listener);
  ASSERT_TRUE(clock.run_until([this] { return station.find("sim-1") != nullptr && state().sample; }, 2s));
}

CommandRecord SystemTest::command(protocol::Command action) {
  const CommandRecord record = refused_command(action);
  EXPECT_EQ(record.state, CommandState::acknowledged) << record.kind << ": " << record.reason;
  return record;
}

CommandRecord SystemTest::refused_command(protocol::Command action) {
  CommandRequest request;
  request.robot_id = "sim-1";
  request.action = action;
  request.actor = "test";
  const auto result = wait_for(station.submit(request));
  if (result) return *result;
  CommandRecord refused;
  refused.state = CommandState::failed;
  refused.reason = result.error().reason;
  return refused;
}

CommandRecord SystemTest::stop() { return wait_for(station.emergency_stop("sim-1", "test", 1s)).value(); }

protocol::Command SystemTest::set_auto(float setpoint_m) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_mode_tag;
  command.action.set_mode.mode = rheonaut_MODE_AUTO;
  command.action.set_mode.has_setpoint_m = true;
  command.action.set_mode.setpoint_m = setpoint_m;
  return command;
}

protocol::Command SystemTest::set_duty(float duty) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_set_duty_tag;
  command.action.set_duty.duty = duty;
  return command;
}

protocol::Command SystemTest::inject_disturbance(float disturbance_m) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_inject_disturbance_tag;
  command.action.inject_disturbance.disturbance_m = disturbance_m;
  return command;
}

protocol::Command SystemTest::clear_emergency(std::uint64_t emergency_id) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = rheonaut_Command_clear_emergency_tag;
  command.action.clear_emergency.emergency_id = emergency_id;
  return command;
}

RunId SystemTest::begin_run() {
  RunConditions conditions;
  conditions.name = "a run of the test";
  return wait_for(runs->create("sim-1", conditions)).value().id;
}

std::vector<StoredSample> SystemTest::samples_of(RunId run) {
  std::vector<StoredSample> samples;
  std::optional<SampleCursor> after;
  do {
    const auto page = wait_for(history->samples(run, after, 1000));
    EXPECT_TRUE(page.has_value());
    samples.insert(samples.end(), page->samples.begin(), page->samples.end());
    after = page->next;
  } while (after);
  return samples;
}

}  // namespace server
