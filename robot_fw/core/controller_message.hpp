// Controllers as messages: their checksum, why the robot refuses one, and conversion from and to a message.
#pragma once

#include "protocol/messages.hpp"
#include "robot_fw/core/controller.hpp"
#include "robot_fw/core/safety.hpp"

namespace robot_fw {

// CRC-32 of the fields 3 to 14 in order.
std::uint32_t checksum_of(const protocol::Controller& controller);

// Why the robot refuses this controller; none when it accepts it.
protocol::RejectReason fault_of(const protocol::Controller& controller, const DutyRange& motor,
                                std::uint32_t sample_period_us);

// The controller must have no fault.
ControllerSections sections_of(const protocol::Controller& controller);
void write_controller(const ControllerSections& sections, std::uint32_t sample_period_us, protocol::Controller& out);

// With its limits within those of the motor, and the checksum that follows.
ControllerSections adapted(ControllerSections sections, const DutyRange& motor, std::uint32_t sample_period_us);

}  // namespace robot_fw
