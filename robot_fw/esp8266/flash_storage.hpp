// Stores parameters and controller over a loss of power, in two sectors of flash that are written in turn.
//
//   record := magic sequence parameters_size controller_size parameters controller crc
// with words of 4 bytes, little-endian, values of 160 and 272, and the CRC-32 of all before it: 452 bytes.
// The sector with the higher sequence is valid. A write erases and fills the other one, so a power cut during a write
// leaves the older record intact. save() keeps the value in RAM; write_pending() writes it, with the motor off.
// The two sectors are the first of the file system's area, which nothing else here uses.
#pragma once

#include "robot_fw/core/settings_store.hpp"
#include "robot_fw/esp8266/motor.hpp"

namespace robot_fw::esp8266 {

class FlashStorage final : public Storage {
 public:
  explicit FlashStorage(const Motor& motor) : motor_(motor) {}

  // Reads the newer record that is sound.
  void begin();
  std::size_t load(StorageKey key, std::uint8_t* bytes, std::size_t capacity) override;
  bool save(StorageKey key, protocol::Bytes bytes) override;
  bool damaged() const override { return damaged_; }
  // Writes what was saved since; blocks for up to half a second when there is something. False when it has failed for
  // the last time.
  bool write_pending();
  bool pending() const { return attempts_left_ > 0; }

 private:
  static constexpr std::size_t kParameterBytes = 160, kControllerBytes = 272;

  struct Record {
    std::uint32_t magic;
    std::uint32_t sequence;
    std::uint32_t parameters_size, controller_size;
    std::uint8_t parameters[kParameterBytes];
    std::uint8_t controller[kControllerBytes];
    std::uint32_t crc;
  };
  static_assert(sizeof(Record) == 452, "flash is written in words, and the format has no gaps");
  static_assert((kParameterCount + 1) * 4 <= kParameterBytes, "the parameters outgrew their place");
  static_assert(rheonaut_Controller_size + 20 <= kControllerBytes, "a controller outgrew its place");

  struct Place {
    std::uint32_t& size;
    std::uint8_t* value;
    std::size_t capacity;
  };
  Place place_of(StorageKey key);

  // Into `record_`; says whether what is there is sound.
  bool read(std::uint32_t sector);
  bool is_blank(std::uint32_t sector) const;
  bool write(std::uint32_t sector);
  bool is_written(std::uint32_t sector) const;

  const Motor& motor_;
  Record record_{};           // as it is or is to be in flash
  std::uint32_t sector_ = 0;  // 0 or 1: where the newest record is
  bool damaged_ = false;      // a sector that is not blank is not sound
  bool there_ = false;        // this flash layout has room for it
  std::uint32_t attempts_left_ = 0;
};

}  // namespace robot_fw::esp8266
