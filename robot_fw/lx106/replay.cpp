// Hands each record to the call of the core that it stands for.
#include "robot_fw/lx106/replay.hpp"

#include <cstring>

namespace robot_fw::lx106 {
namespace {

RobotConfig config() {
  RobotConfig config;
  config.robot_id = "lx106";
  config.token = "replay";
  config.firmware_version = "replay";
  config.boot_id = Replay::kBootId;
  return config;
}

char* put_text(char* at, const char* text) {
  const std::size_t size = std::strlen(text);
  std::memcpy(at, text, size);
  return at + size;
}

char* put_hex(char* at, std::uint64_t value, unsigned digits) {
  for (unsigned i = digits; i-- > 0;) *at++ = "0123456789abcdef"[(value >> (4 * i)) & 15];
  return at;
}

}  // namespace

Replay::Replay() : robot_(config()) {}

void Replay::play(const Record& record) {
  sent_bytes_ = 0;
  switch (record.kind) {
    case RecordKind::tick: robot_.step(record.inputs, record.dt_s); return;
    case RecordKind::bytes:
      wants_connection_ = robot_.receive({record.bytes.data(), record.size}, record.now_us);
      return;
    case RecordKind::transmit: sent_bytes_ = robot_.transmit(frame_.data(), record.size, record.now_us); return;
    case RecordKind::opened: robot_.link_opened(record.now_us); return;
    case RecordKind::closed: robot_.link_closed(record.now_us); return;
  }
}

std::size_t Replay::describe(const Record& record, char (&line)[kMaxLineBytes]) const {
  const bool closes = record.kind == RecordKind::bytes && !wants_connection_;
  const bool ticks = record.kind == RecordKind::tick;
  if (!ticks && !closes && sent_bytes_ == 0) return 0;
  char* at = put_text(line, ticks ? "tick " : closes ? "closes " : "sent ");
  at = put_hex(at, record.now_us, 10);
  *at++ = ' ';
  if (ticks) at = put_hex(at, robot_.float_state_checksum(), 8);
  for (std::size_t i = 0; i < sent_bytes_; ++i) at = put_hex(at, frame_[i], 2);
  *at++ = '\n';
  return static_cast<std::size_t>(at - line);
}

}  // namespace robot_fw::lx106
