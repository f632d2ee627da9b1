// The sketch: one robot, begun once and stepped for ever. docs/hardware.md says how it gets onto the board.
#include <rheonaut_robot.h>

#include "secrets.hpp"

static robot_fw::esp8266::Board board{kSecrets};

// SAFETY: a software reset leaves pins as they were; the core calls this before anything else of ours.
extern "C" void preinit() { robot_fw::esp8266::force_motor_off(robot_fw::esp8266::kSettings.motor.pwm_pin); }

// SAFETY: the core calls this when the program has crashed, after it has printed where.
extern "C" void custom_crash_callback(struct rst_info*, std::uint32_t, std::uint32_t) {
  robot_fw::esp8266::force_motor_off(robot_fw::esp8266::kSettings.motor.pwm_pin);
}

void setup() { board.begin(); }

void loop() { board.step(); }
