// A recorder with one robot: what it is sent, and what it has stored.
#pragma once

#include <string>
#include <vector>

#include "server/storage/ingest/recorder.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {

class RecorderFixture : public RecordingTest {
 protected:
  using Rows = std::vector<std::string>;

  Rows segments() { return rows("SELECT first_seq, last_seq FROM segment ORDER BY first_seq"); }
  Rows gaps() { return rows("SELECT first_seq, last_seq, cause FROM gap ORDER BY first_seq"); }
  std::int64_t samples() { return number("SELECT count(*) FROM sample"); }

  void send_event(const TestRobot& robot, std::uint64_t event_seq, std::uint64_t oldest = 0) {
    station::RobotEvent event;
    event.robot_id = robot.id;
    event.boot_id = robot.boot_id;
    event.event_seq = event_seq;
    event.oldest_event_seq = oldest;
    event.kind = "mode_changed";
    event.cause = "command";
    event.mode = rheonaut_MODE_AUTO;
    recorder_->on_event(state_of(robot, station::LinkState::connected), event);
  }

  void send_command(station::CommandId id, const char* kind, station::CommandState state) {
    station::CommandRecord command;
    command.id = id;
    command.robot_id = robot_.id;
    command.kind = kind;
    command.state = state;
    recorder_->on_command(command);
  }

  TestRobot robot_;
};

}  // namespace server
