// How soon the bytes that come in on a robot's connection are read.
#pragma once

#include <cstdint>

namespace server::net {

enum class ReadPace : std::uint8_t {
  quiet,    // PollSet::kQuietPause after the last time: nobody waits for them
  prompt,   // PollSet::kPause after the others' at most
  awaited,  // before all others: an answer is expected
};

}  // namespace server::net
