// Which command may run in which mode.
//
// mode_table.cpp has the table, docs/robot.md describes it, and mode_table_test.cpp tests every row, state and event.
#pragma once

#include "protocol/messages.hpp"

namespace robot_fw {

// Why a command (its tag in Command) is refused in this mode; none when it may run.
protocol::RejectReason refusal_in(protocol::Mode mode, pb_size_t action);

}  // namespace robot_fw
