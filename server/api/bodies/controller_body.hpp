// Converts a controller from the body of a request to the message for the robot.
#pragma once

#include "server/api/bodies/json.hpp"

namespace server::api {

// Reads the members `controller`, `controller_id`, `duty_min`, `duty_max` and `derivative_on` of a command's body.
// `controller` is what `rheonaut discretise --json` prints, or what a robot is said to run (GET …/controller).
// What is left out: the duty range and derivative_on are those of `in_force`, or an error where that is null; the
// checksum is computed; the id is the checksum's lower 24 bits, so that the same controller has the same id.
Result<protocol::Controller> controller_from(const Members& body, const protocol::Controller* in_force);

// CRC-32 of its coefficients, as docs/protocol.md says.
std::uint32_t checksum_of(const protocol::Controller& controller);

}  // namespace server::api
