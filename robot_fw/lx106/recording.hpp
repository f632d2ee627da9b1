// A recorded session: the inputs of a robot's core, call by call, as bytes.
//
//   recording := record*
//   record    := kind:u8 now_us:u64 body
//   tick      := acceleration_counts:i16 acceleration_is_valid:u8 has_known_motion:u8 position_m:f32 velocity_m_s:f32
//                acceleration_m_s2:f32 impedance_mv:f32 supply_mv:f32 rssi_dbm:i32 free_memory_bytes:u32 tick_us:u32
//                missed_ticks:u32 imu_calibration:u32 dt_s:f32
//   bytes     := size:u16 byte*
//   transmit  := capacity:u16
//   opened, closed := (nothing)
//   numbers are little-endian
#pragma once

#include <array>

#include "protocol/frame.hpp"
#include "robot_fw/core/hardware_io.hpp"

namespace robot_fw::lx106 {

enum class RecordKind : std::uint8_t { tick = 1, bytes, transmit, opened, closed };

struct Record {
  RecordKind kind = RecordKind::tick;
  std::uint64_t now_us = 0;
  Inputs inputs;           // tick; its robot_time_us is now_us
  float dt_s = 0;          // tick
  std::uint16_t size = 0;  // of `bytes` (bytes); the room for a frame (transmit)
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes{};
};

// Where a recording comes from: a file, or QEMU's standard input.
class RecordingSource {
 public:
  // False when fewer bytes are left.
  virtual bool read(void* to, std::size_t size) = 0;

 protected:
  ~RecordingSource() = default;
};

class RecordingSink {
 public:
  virtual void write(const void* from, std::size_t size) = 0;

 protected:
  ~RecordingSink() = default;
};

// False at the end, and for bytes that are no record.
bool read_record(RecordingSource& source, Record& record);
void write_record(RecordingSink& sink, const Record& record);

}  // namespace robot_fw::lx106
