// Stub of the version that the Arduino core's build writes.
#pragma once

#define ARDUINO_ESP8266_MAJOR 3
#define ARDUINO_ESP8266_MINOR 1
#define ARDUINO_ESP8266_REVISION 2
