// What a station might say, built from the fuzzer's bytes: near enough to sense that the robot listens.
#pragma once

#include "protocol/messages.hpp"
#include "tests/fuzz/byte_source.hpp"

namespace fuzz {

// What the station knows of the robot.
struct KnownOfRobot {
  std::uint64_t boot_id = 0;
  std::uint64_t now_us = 0;
  std::uint64_t next_seq = 0;
  std::uint64_t emergency_id = 0;
};

protocol::StationFrame welcome(ByteSource& source, const KnownOfRobot& robot);
protocol::StationFrame heartbeat(ByteSource& source, const KnownOfRobot& robot);
// The first byte says which action, the second how sound its identity and time to live are.
protocol::Command command(ByteSource& source, const KnownOfRobot& robot);
protocol::StationFrame frame_of(const protocol::Command& command);

}  // namespace fuzz
