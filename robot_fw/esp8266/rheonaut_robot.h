// The name under which the sketch finds the robot among the Arduino libraries.
#pragma once

#include <user_interface.h>

#include "robot_fw/esp8266/board.hpp"

// What the core calls of the sketch. Declared here, since the IDE would declare them without the "C".
extern "C" void preinit();
extern "C" void custom_crash_callback(struct rst_info* reset_info, std::uint32_t stack, std::uint32_t stack_end);
