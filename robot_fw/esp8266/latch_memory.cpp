// Reads and writes the record.
#include "robot_fw/esp8266/latch_memory.hpp"

#include <Arduino.h>

#include "robot_fw/core/crc32.hpp"

namespace robot_fw::esp8266 {
namespace {

constexpr std::uint32_t kFirstWord = 64;  // the first 32 words are the boot loader's
constexpr std::uint32_t kMagic = 0x4C'48'52'31;
constexpr std::size_t kWords = 5, kMagicAt = 0, kIdLowAt = 1, kIdHighAt = 2, kCauseAt = 3, kCrcAt = 4;

std::uint32_t crc_of(const std::uint32_t* words) {
  Crc32 crc;
  crc.add(words, kCrcAt * sizeof(words[0]));
  return crc.value();
}

}  // namespace

void LatchMemory::begin() {
  std::uint32_t words[kWords]{};
  kept_ = ESP.rtcUserMemoryRead(kFirstWord, words, sizeof(words)) && words[kMagicAt] == kMagic &&
          words[kCrcAt] == crc_of(words);
  if (kept_) {
    emergency_id_ = static_cast<std::uint64_t>(words[kIdHighAt]) << 32 | words[kIdLowAt];
    cause_ = static_cast<protocol::EmergencyCause>(words[kCauseAt]);
  }
  write();
}

void LatchMemory::keep(std::uint64_t emergency_id, protocol::EmergencyCause cause) {
  if (emergency_id == emergency_id_ && cause == cause_) return;
  emergency_id_ = emergency_id;
  cause_ = cause;
  write();
}

void LatchMemory::write() const {
  std::uint32_t words[kWords]{};
  words[kMagicAt] = kMagic;
  words[kIdLowAt] = static_cast<std::uint32_t>(emergency_id_);
  words[kIdHighAt] = static_cast<std::uint32_t>(emergency_id_ >> 32);
  words[kCauseAt] = static_cast<std::uint32_t>(cause_);
  words[kCrcAt] = crc_of(words);
  ESP.rtcUserMemoryWrite(kFirstWord, words, sizeof(words));
}

}  // namespace robot_fw::esp8266
