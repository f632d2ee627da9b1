// Decides who may command which robot: by the leases of Authority, by the reservations, and by the age of the state
// that the request saw.
//
// Emergency stops are never checked here. Publishes nothing: changes are returned. Loop thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/station/commands/authority.hpp"
#include "server/station/commands/requests.hpp"

namespace server::station {

const char* text(ControlAction action);

class CommandAuthority {
 public:
  explicit CommandAuthority(runtime::Clock& clock) : authority_{clock, reservations_} {}

  ControlState of(const RobotId& robot) const { return authority_.of(robot); }
  Result<void> may_use(const RobotId& robot, const std::string& actor) const {
    return authority_.may_use(robot, actor);
  }

  bool is_kept_by(const RobotId& robot, const Client& client) const { return authority_.is_kept_by(robot, client); }
  Client client_of(const RobotId& robot) const { return authority_.client_of(robot); }

  const Reservations& reservations() const { return reservations_; }
  Reservations& reservations() { return reservations_; }
  const Reservation* keeps_out(const RobotId& robot, const std::string& actor, microseconds ahead) const {
    return authority_.keeps_out(robot, actor, ahead);
  }

  // Whether the command, once it is sent, brings another client of the holder into control.
  bool changes_client(const CommandRequest& request) const;
  // conflict when the command needs control of the robot and another has it, or has reserved the robot.
  Result<void> may_command(const CommandRequest& request) const;
  // conflict when what its page saw was too old for what the command would do.
  Result<void> check_sight(const CommandRequest& request) const;
  // A command has been sent: commanding a robot that nobody controls takes control. Returns the change, if any.
  std::optional<Authority::Change> on_commanded(const CommandRequest& request);

  // What a request for control changes, if anything.
  Result<std::optional<Authority::Change>> change(const ControlRequest& request);
  // The client is still there, for this robot; none: for what it controls, of a client without an id.
  void keep(const Client& client, const std::optional<RobotId>& robot, microseconds age);
  std::vector<Authority::Change> expire() { return authority_.expire(); }
  std::optional<Authority::Change> end_right(const RobotId& robot, const runtime::EndedRight& right) {
    return authority_.end_right(robot, right);
  }

 private:
  Reservations reservations_;
  Authority authority_;
};

}  // namespace server::station
