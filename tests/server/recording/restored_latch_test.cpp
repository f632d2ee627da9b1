// SAFETY: what a station that starts again knows of a robot's latch, from whichever of its traces is the latest.
#include "tests/server/recording/recorder_fixture.hpp"

namespace server {
namespace {

class RestoredLatchTest : public RecorderFixture {};

TEST_F(RestoredLatchTest, RestoresTheLatestBootAndTheLatchItWasIn) {
  const auto restored = [this] {
    flush();
    kill();
    start();
    return restored_.robots.at(0);
  };
  const auto send_latch = [this](std::uint64_t seq, const char* kind, std::uint64_t id, std::uint64_t robot_time_us) {
    station::RobotEvent event;
    event.robot_id = robot_.id;
    event.boot_id = robot_.boot_id;
    event.event_seq = seq;
    event.kind = kind;
    event.emergency_id = id;
    event.robot_time_us = robot_time_us;
    recorder_->on_event(state_of(robot_, station::LinkState::connected), event);
  };
  const auto send_stop = [this](std::uint64_t effect_at_robot_us, std::uint64_t id) {
    station::CommandRecord stop;
    stop.id = 77;
    stop.robot_id = robot_.id;
    stop.boot_id = robot_.boot_id;
    stop.kind = "emergency_stop";
    stop.state = station::CommandState::acknowledged;
    stop.effect_at_robot_us = effect_at_robot_us;
    stop.emergency_id = id;
    recorder_->on_command(stop);
  };
  start();
  connect(robot_);
  EXPECT_EQ(restored().boot_id, robot_.boot_id);
  EXPECT_EQ(restored_.robots.at(0).emergency_id, 0u);

  connect(robot_);
  make(robot_, 10);
  send_latch(0, "emergency", 0xf000000000000001, robot_.time_of(9) + 1);  // its samples have not come
  EXPECT_EQ(restored().emergency_id, 0xf000000000000001);

  connect(robot_);
  robot_.context.emergency_id = 0xf000000000000002;  // of a stop whose event has not come
  make(robot_, 10);
  EXPECT_EQ(restored().emergency_id, 0xf000000000000002);

  connect(robot_);
  send_latch(1, "mode_changed", 5, robot_.time_of(30));  // says nothing of the latch
  send_latch(2, "emergency_cleared", 0xf000000000000002, robot_.time_of(19) + 1);
  EXPECT_EQ(restored().emergency_id, 0u);

  connect(robot_);
  send_stop(robot_.time_of(25), 0xf000000000000003);  // neither its event nor its samples have come
  EXPECT_EQ(restored().emergency_id, 0xf000000000000003);

  connect(robot_);
  send_latch(3, "emergency_cleared", 0xf000000000000003, robot_.time_of(26));
  EXPECT_EQ(restored().emergency_id, 0u);

  TestRobot rebooted;
  rebooted.boot_id = 3;  // a smaller number, and a later boot
  connect(rebooted);
  EXPECT_EQ(restored().boot_id, 3u);
}

class RestoredMoverTest : public RecorderFixture {};

TEST_F(RestoredMoverTest, IsWhoseCommandMovedTheLatestBootLast) {
  std::uint64_t id = 0;
  const auto record = [this, &id](const char* kind, const std::string& actor, station::BootId boot_id,
                                  bool was_sent = true) {
    station::CommandRecord command;
    command.id = ++id;
    command.robot_id = robot_.id;
    command.boot_id = boot_id;
    command.kind = kind;
    command.actor = actor;
    command.state = station::CommandState::acknowledged;
    command.submitted_at_us = static_cast<std::int64_t>(id);
    if (was_sent) command.sent_at_us = command.submitted_at_us;
    recorder_->on_command(command);
  };
  const auto mover = [this] {
    flush();
    kill();
    start();
    return restored_.robots.at(0).moves_for;
  };
  start();
  connect(robot_);
  EXPECT_EQ(mover(), "");
  connect(robot_);
  record("set_duty", "token:first", robot_.boot_id);
  record("set_mode", "token:ci", robot_.boot_id);
  record("set_parameter", "token:other", robot_.boot_id);
  record("set_setpoint", "token:before", robot_.boot_id + 1);
  record("set_duty", "token:late", robot_.boot_id, false);  // it was too old on arrival
  EXPECT_EQ(mover(), "token:ci");
  connect(robot_);
  record("set_mode", "station:experiments", robot_.boot_id);
  EXPECT_EQ(mover(), "station:experiments") << "to rest";
}

}  // namespace
}  // namespace server
