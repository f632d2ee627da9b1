// Whether telemetry alone proves that a command has run, when its answer is lost. Pure.
//
// The effect is a proof only if nothing else explains it: neither the robot's earlier state, nor another command for
// the motor, sent before or after this one; and only while the command can have taken effect.
#pragma once

#include <cstdint>

#include "server/station/commands/robot_commands.hpp"

namespace server::station {

// A command is being sent at this time of the robot: notes from when and until when its effect is a proof, and that it
// is none for the others any more.
void prepare_proof(const RobotState& robot, const RobotCommands& commands, PendingCommand& pending,
                   std::uint64_t robot_now_us);

bool is_proved(const PendingCommand& pending, const SampleBatch& batch);

}  // namespace server::station
