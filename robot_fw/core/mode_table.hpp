// Which command may run in which mode.
//
// The whole of it is one table in mode_table.cpp; docs/robot.md has it for readers, mode_table_test.cpp goes through
// every row, state and event.
#pragma once

#include "protocol/messages.hpp"

namespace robot_fw {

// Why a command (its tag in Command) is refused in this mode; none when it may run.
protocol::RejectReason refusal_in(protocol::Mode mode, pb_size_t action);

}  // namespace robot_fw
