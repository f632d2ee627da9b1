// Reads and writes the two sectors.
#include "robot_fw/esp8266/flash_storage.hpp"

#include <Arduino.h>
#include <flash_hal.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "robot_fw/core/crc32.hpp"

namespace robot_fw::esp8266 {
namespace {

constexpr std::uint32_t kMagic = 0x31'4E'48'52;  // "RHN1"
constexpr std::uint32_t kSectorBytes = 4096;
constexpr std::uint32_t kAttempts = 3;

std::uint32_t address_of(std::uint32_t sector) { return FS_PHYS_ADDR + sector * kSectorBytes; }

template <typename Record>
std::uint32_t crc_of(const Record& record) {
  Crc32 crc;
  crc.add(&record, offsetof(Record, crc));
  return crc.value();
}

template <typename Record>
std::uint32_t* words_of(Record& record) {
  return reinterpret_cast<std::uint32_t*>(&record);
}

}  // namespace

bool FlashStorage::read(std::uint32_t sector) {
  return ESP.flashRead(address_of(sector), words_of(record_), sizeof(Record)) && record_.magic == kMagic &&
         record_.parameters_size <= kParameterBytes && record_.controller_size <= kControllerBytes &&
         record_.crc == crc_of(record_);
}

bool FlashStorage::is_blank(std::uint32_t sector) const {
  std::uint32_t magic = 0;
  return ESP.flashRead(address_of(sector), &magic, sizeof(magic)) && magic == 0xFFFF'FFFFU;
}

void FlashStorage::begin() {
  there_ = FS_PHYS_SIZE >= 2 * kSectorBytes;
  if (!there_) return;
  const bool first = read(0);
  const std::uint32_t first_sequence = record_.sequence;
  const bool second = read(1);
  damaged_ = (!first && !is_blank(0)) || (!second && !is_blank(1));  // as a write that was cut off leaves it, too
  sector_ = 1;  // where neither is sound, the first write goes to sector 0
  if (second && (!first || record_.sequence > first_sequence)) return;
  if (first && read(0)) {
    sector_ = 0;
  } else {
    record_ = Record{};
  }
}

FlashStorage::Place FlashStorage::place_of(StorageKey key) {
  if (key == StorageKey::parameters) return {record_.parameters_size, record_.parameters, kParameterBytes};
  return {record_.controller_size, record_.controller, kControllerBytes};
}

std::size_t FlashStorage::load(StorageKey key, std::uint8_t* bytes, std::size_t capacity) {
  const Place place = place_of(key);
  if (place.size > capacity) return 0;
  std::copy_n(place.value, place.size, bytes);
  return place.size;
}

bool FlashStorage::save(StorageKey key, protocol::Bytes bytes) {
  const Place place = place_of(key);
  if (!there_ || bytes.size > place.capacity) return false;
  std::copy(bytes.begin(), bytes.end(), place.value);
  place.size = static_cast<std::uint32_t>(bytes.size);
  attempts_left_ = kAttempts;
  return true;
}

bool FlashStorage::write_pending() {
  // SAFETY: erasing stops the program for up to 0.4 s, in which no tick controls the motor.
  if (attempts_left_ == 0 || !motor_.is_off()) return true;
  --attempts_left_;
  record_.magic = kMagic;
  ++record_.sequence;
  record_.crc = crc_of(record_);
  const std::uint32_t other = 1 - sector_;
  if (!write(other)) return attempts_left_ > 0;
  sector_ = other;
  attempts_left_ = 0;
  return true;
}

bool FlashStorage::write(std::uint32_t sector) {
  return ESP.flashEraseSector(address_of(sector) / kSectorBytes) &&
         ESP.flashWrite(address_of(sector), words_of(record_), sizeof(Record)) && is_written(sector);
}

// Reads it back in small pieces.
bool FlashStorage::is_written(std::uint32_t sector) const {
  const auto* expected = reinterpret_cast<const std::uint8_t*>(&record_);
  std::uint32_t piece[16];
  for (std::uint32_t at = 0; at < sizeof(Record); at += sizeof(piece)) {
    const std::size_t size = std::min(sizeof(piece), sizeof(Record) - at);
    if (!ESP.flashRead(address_of(sector) + at, piece, size) || std::memcmp(expected + at, piece, size) != 0)
      return false;
  }
  return true;
}

}  // namespace robot_fw::esp8266
