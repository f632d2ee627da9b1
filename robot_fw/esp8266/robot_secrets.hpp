// The struct of the values in secrets.example.hpp.
#pragma once

#include <cstdint>

namespace robot_fw::esp8266 {

// All text outlives the robot.
struct Secrets {
  const char* robot_id;
  const char* token;
  const char* wifi_name;
  const char* wifi_password;
  const char* station_host;
  std::uint16_t station_port;
  const char* station_key_pem;  // pinned: a station with another key is not talked to
};

}  // namespace robot_fw::esp8266
