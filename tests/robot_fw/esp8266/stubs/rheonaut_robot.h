// What the assembled Arduino library puts in its root.
#include "robot_fw/esp8266/rheonaut_robot.h"
