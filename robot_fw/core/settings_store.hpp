// Parameters and controller as the board stores them over a reset.
//
//   parameters := value* checksum     each value of the table in its order, then Parameters::checksum(), which covers
//                                     the names, too: it differs for the table of another firmware
//   controller := RobotFrame crc      the message as on the wire, then the CRC-32 of its bytes
//   numbers are 4 bytes, little-endian
// Without a matching record the defaults stay.
#pragma once

#include <optional>

#include "protocol/messages.hpp"
#include "robot_fw/core/parameters.hpp"

namespace robot_fw {

enum class StorageKey : std::uint8_t { parameters = 1, controller = 2 };

// A few bytes under each key, kept by the board over resets. The core saves only while the motor is off.
class Storage {
 public:
  static constexpr std::size_t kMaxBytes = 320;  // of one value

  // Fills `bytes` and says how many there are; 0 when nothing is kept.
  virtual std::size_t load(StorageKey key, std::uint8_t* bytes, std::size_t capacity) = 0;
  // Something was kept and has decayed: what load() gives is older, or nothing.
  virtual bool damaged() const { return false; }
  // False when it could not be kept.
  virtual bool save(StorageKey key, protocol::Bytes bytes) = 0;

 protected:
  ~Storage() = default;
};

bool is_kept(Storage& storage, StorageKey key);  // anything, good or bad

bool save_parameters(Storage& storage, const Parameters& parameters);
// The table as it was saved; empty when none is there, or a value is out of its range by now.
std::optional<Parameters> load_parameters(Storage& storage);

bool save_controller(Storage& storage, const protocol::Controller& controller);
// The caller judges the controller as one from the link.
std::optional<protocol::Controller> load_controller(Storage& storage);

}  // namespace robot_fw
