// The name under which the sketch finds the robot among the Arduino libraries.
#pragma once

#include "robot_fw/esp8266/robot_port.hpp"
