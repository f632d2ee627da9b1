// What a user fills in: here the example itself, so that it keeps compiling.
#include "robot_fw/esp8266/secrets.example.hpp"
