// Who this robot is and whom it trusts. Copy to secrets.hpp, fill in, and keep that copy to yourself.
// The key below is an example.
#pragma once

#include "robot_fw/esp8266/robot_secrets.hpp"

constexpr robot_fw::esp8266::Secrets kSecrets{
    "robot-1",          // robot id: 1 to 31 characters of [a-z0-9_-]
    "enrolment-token",  // as in the station's list of robots, at most 71 characters
    "wifi-name", "wifi-password",
    "192.0.2.1",  // the station: an address is better than a name, which has to be looked up first
    7070,
    // The station's public key, as `rheonaut certificate` prints it
    R"(-----BEGIN PUBLIC KEY-----
MFkwEwYHKoZIzj0CAQYIKoZIzj0DAQcDQgAENU6ZTCnv5rm42xjDv+mO8uYdCPnT
Jdf9N2ln1Lt3/R4/JR0Yi2jrZj4yF5IjmmUyBj0DPF7c1QASa+F6q1hYyw==
-----END PUBLIC KEY-----
)"};
