// Reads and writes records field by field, in one order for both.
#include "robot_fw/lx106/recording.hpp"

namespace robot_fw::lx106 {
namespace {

struct Reader {
  RecordingSource& source;
  bool good = true;
  template <class Number>
  void field(Number& value) {
    good = good && source.read(&value, sizeof(value));
  }
};

struct Writer {
  RecordingSink& sink;
  template <class Number>
  void field(const Number& value) {
    sink.write(&value, sizeof(value));
  }
};

template <class Codec, class TickInputs>
void code_inputs(Codec& codec, TickInputs& inputs, Motion& motion) {
  codec.field(motion.position_m);
  codec.field(motion.velocity_m_s);
  codec.field(motion.acceleration_m_s2);
  codec.field(inputs.impedance_mv);
  codec.field(inputs.supply_mv);
  codec.field(inputs.rssi_dbm);
  codec.field(inputs.free_memory_bytes);
  codec.field(inputs.tick_us);
  codec.field(inputs.missed_ticks);
  codec.field(inputs.imu_calibration);
}

bool read_tick(Reader& reader, Record& record) {
  Inputs& inputs = record.inputs;
  std::uint8_t is_valid = 0, has_motion = 0;
  Motion motion;
  reader.field(inputs.acceleration_counts);
  reader.field(is_valid);
  reader.field(has_motion);
  code_inputs(reader, inputs, motion);
  reader.field(record.dt_s);
  inputs.robot_time_us = record.now_us;
  inputs.acceleration_is_valid = is_valid != 0;
  inputs.known_motion.reset();
  if (has_motion != 0) inputs.known_motion = motion;
  return reader.good;
}

void write_tick(Writer& writer, const Record& record) {
  const Inputs& inputs = record.inputs;
  Motion motion = inputs.known_motion.value_or(Motion{});
  writer.field(inputs.acceleration_counts);
  writer.field(static_cast<std::uint8_t>(inputs.acceleration_is_valid));
  writer.field(static_cast<std::uint8_t>(inputs.known_motion.has_value()));
  code_inputs(writer, inputs, motion);
  writer.field(record.dt_s);
}

}  // namespace

bool read_record(RecordingSource& source, Record& record) {
  Reader reader{source};
  reader.field(record.kind);
  reader.field(record.now_us);
  record.size = 0;
  switch (record.kind) {
    case RecordKind::tick: return read_tick(reader, record);
    case RecordKind::opened:
    case RecordKind::closed: return reader.good;
    case RecordKind::transmit: reader.field(record.size); return reader.good && record.size <= record.bytes.size();
    case RecordKind::bytes:
      reader.field(record.size);
      return reader.good && record.size <= record.bytes.size() && source.read(record.bytes.data(), record.size);
  }
  return false;
}

void write_record(RecordingSink& sink, const Record& record) {
  Writer writer{sink};
  writer.field(record.kind);
  writer.field(record.now_us);
  if (record.kind == RecordKind::tick) write_tick(writer, record);
  if (record.kind == RecordKind::bytes || record.kind == RecordKind::transmit) writer.field(record.size);
  if (record.kind == RecordKind::bytes) sink.write(record.bytes.data(), record.size);
}

}  // namespace robot_fw::lx106
