// What people say of a robot, which holds whether or not it is connected: that it is retired.
#include "server/station/seat.hpp"

namespace server {

void Station::set_retired(const RobotId& id, std::int64_t retired_at_us, const std::string& actor) {
  const auto found = robots_.find(id);
  if (found == robots_.end() || found->second.retired_at_us == retired_at_us) return;
  RobotState& robot = found->second;
  const bool was_retired = robot.retired_at_us != 0;
  robot.retired_at_us = retired_at_us;
  if (was_retired != (retired_at_us != 0)) note(robot, was_retired ? "unretired" : "retired", "by " + actor);
  publish(robot);
}

}  // namespace server
