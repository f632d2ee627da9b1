// Encodes and decodes through nanopb, and names the enumerators.
#include "protocol/messages.hpp"

#include <pb_common.h>
#include <pb_decode.h>
#include <pb_encode.h>

#include <cstring>

namespace protocol {
namespace {

bool has_content(const RobotFrame& frame) { return frame.which_body != 0; }
bool has_content(const StationFrame& frame) { return frame.which_body != 0; }
bool has_content(const Command& command) { return command.which_action != 0; }

template <class Message>
std::size_t encode_any(const pb_msgdesc_t* fields, const Message& message, std::uint8_t* out, std::size_t capacity) {
  pb_ostream_t stream = pb_ostream_from_buffer(out, capacity);
  if (!has_content(message) || !pb_encode(&stream, fields, &message)) return 0;
  return stream.bytes_written;
}

// One variable and one return, so that a message, which is large, lies on the robot's stack only once.
template <class Message>
std::optional<Message> decode_any(const pb_msgdesc_t* fields, Bytes payload) {
  std::optional<Message> message{std::in_place};
  pb_istream_t stream = pb_istream_from_buffer(payload.first, payload.size);
  if (!pb_decode(&stream, fields, &*message) || !has_content(*message)) message.reset();
  return message;
}

// Part of decoding, as a length that does not fit is: the columns of a batch are one list of samples. What the numbers
// say is judged by the receiver.
bool columns_agree(const Telemetry& batch) {
  const pb_size_t count = batch.position_m_count;
  return count > 0 && batch.velocity_m_s_count == count && batch.acceleration_m_s2_count == count &&
         batch.duty_count == count && batch.impedance_mv_count == count && batch.reference_m_count == count;
}

bool encode_uint64(pb_ostream_t& stream, std::uint32_t tag, std::uint64_t value) {
  return value == 0 || (pb_encode_tag(&stream, PB_WT_VARINT, tag) && pb_encode_varint(&stream, value));
}

// A submessage as nanopb encodes it, to `out`, where `stream` writes. But nanopb encodes it twice, first for its length
// alone, and that is half of a frame's cost on a robot. Here it is written behind one byte of length, and moved if it
// needs two.
bool encode_once(pb_ostream_t& stream, const pb_field_iter_t& field, std::uint8_t* out, std::size_t capacity) {
  static_assert(rheonaut_RobotFrame_size < 1 << 14, "the length of a submessage may need three bytes");
  if (!pb_encode_tag(&stream, PB_WT_STRING, field.tag)) return false;
  std::size_t at = stream.bytes_written + 1;
  if (at > capacity) return false;
  pb_ostream_t inner = pb_ostream_from_buffer(out + at, capacity - at);
  if (!pb_encode(&inner, field.submsg_desc, field.pData)) return false;
  const std::size_t length = inner.bytes_written;
  if (length >= 0x80) {
    if (at + 1 + length > capacity) return false;
    std::memmove(out + at + 1, out + at, length);
    ++at;
  }
  if (!pb_encode_varint(&stream, length)) return false;
  stream.bytes_written = at + length;
  return true;
}

}  // namespace

std::size_t encode(const RobotFrame& frame, std::uint8_t* out, std::size_t capacity) {
  pb_field_iter_t body;
  if (!pb_field_iter_begin_const(&body, rheonaut_RobotFrame_fields, &frame)) return 0;
  pb_ostream_t stream = pb_ostream_from_buffer(out, capacity);
  const bool fits = encode_uint64(stream, rheonaut_RobotFrame_robot_time_us_tag, frame.robot_time_us) &&
                    pb_field_iter_find(&body, frame.which_body) && encode_once(stream, body, out, capacity);
  return fits ? stream.bytes_written : 0;
}

std::size_t encode(const StationFrame& frame, std::uint8_t* out, std::size_t capacity) {
  return encode_any(rheonaut_StationFrame_fields, frame, out, capacity);
}

std::size_t encode(const Command& command, std::uint8_t* out, std::size_t capacity) {
  return encode_any(rheonaut_Command_fields, command, out, capacity);
}

bool decode_robot_frame(Bytes payload, RobotFrame& into) {
  pb_istream_t stream = pb_istream_from_buffer(payload.first, payload.size);
  if (!pb_decode(&stream, rheonaut_RobotFrame_fields, &into) || !has_content(into)) return false;
  return into.which_body != rheonaut_RobotFrame_telemetry_tag || columns_agree(into.body.telemetry);
}

std::optional<RobotFrame> decode_robot_frame(Bytes payload) {
  std::optional<RobotFrame> frame{std::in_place};
  if (!decode_robot_frame(payload, *frame)) frame.reset();
  return frame;
}

std::optional<StationFrame> decode_station_frame(Bytes payload) {
  return decode_any<StationFrame>(rheonaut_StationFrame_fields, payload);
}

std::optional<Command> decode_command(Bytes payload) { return decode_any<Command>(rheonaut_Command_fields, payload); }

const char* text(Mode value) {
  switch (value) {
    case rheonaut_MODE_UNSPECIFIED: return "unspecified";
    case rheonaut_MODE_MANUAL: return "manual";
    case rheonaut_MODE_AUTO: return "auto";
    case rheonaut_MODE_EMERGENCY: return "emergency";
  }
  return "unknown";
}

const char* text(SubState value) {
  switch (value) {
    case rheonaut_SUB_STATE_NONE: return "none";
    case rheonaut_SUB_STATE_NAVIGATING: return "navigating";
    case rheonaut_SUB_STATE_HOLDING: return "holding";
    case rheonaut_SUB_STATE_DELIVERING: return "delivering";
  }
  return "unknown";
}

const char* text(ResetCause value) {
  switch (value) {
    case rheonaut_RESET_CAUSE_UNKNOWN: return "unknown";
    case rheonaut_RESET_CAUSE_POWER_ON: return "power_on";
    case rheonaut_RESET_CAUSE_SOFTWARE: return "software";
    case rheonaut_RESET_CAUSE_WATCHDOG: return "watchdog";
    case rheonaut_RESET_CAUSE_BROWN_OUT: return "brown_out";
    case rheonaut_RESET_CAUSE_EXTERNAL: return "external";
  }
  return "unknown";
}

const char* text(EmergencyCause value) {
  switch (value) {
    case rheonaut_EMERGENCY_CAUSE_NONE: return "none";
    case rheonaut_EMERGENCY_CAUSE_OPERATOR: return "operator";
    case rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK: return "sensor_stuck";
    case rheonaut_EMERGENCY_CAUSE_SENSOR_OUT_OF_RANGE: return "sensor_out_of_range";
    case rheonaut_EMERGENCY_CAUSE_SENSOR_MISSING: return "sensor_missing";
    case rheonaut_EMERGENCY_CAUSE_POSITION_LIMIT: return "position_limit";
    case rheonaut_EMERGENCY_CAUSE_TIME_AT_POWER: return "time_at_power";
    case rheonaut_EMERGENCY_CAUSE_INTERNAL_ERROR: return "internal_error";
    case rheonaut_EMERGENCY_CAUSE_RESET: return "reset";
    case rheonaut_EMERGENCY_CAUSE_MOTOR_SUPPLY_CUT: return "motor_supply_cut";
  }
  return "unknown";
}

const char* text(EventKind value) {
  switch (value) {
    case rheonaut_EVENT_KIND_UNSPECIFIED: return "unspecified";
    case rheonaut_EVENT_KIND_BOOT: return "boot";
    case rheonaut_EVENT_KIND_MODE_CHANGED: return "mode_changed";
    case rheonaut_EVENT_KIND_SUB_STATE_CHANGED: return "sub_state_changed";
    case rheonaut_EVENT_KIND_EMERGENCY: return "emergency";
    case rheonaut_EVENT_KIND_EMERGENCY_CLEARED: return "emergency_cleared";
    case rheonaut_EVENT_KIND_LINK_LOST: return "link_lost";
    case rheonaut_EVENT_KIND_LINK_RESTORED: return "link_restored";
    case rheonaut_EVENT_KIND_LEASE_LAPSED: return "lease_lapsed";
    case rheonaut_EVENT_KIND_DUTY_SCHEDULE_ENDED: return "duty_schedule_ended";
    case rheonaut_EVENT_KIND_SETPOINT_CHANGED: return "setpoint_changed";
    case rheonaut_EVENT_KIND_DISTURBANCE: return "disturbance";
    case rheonaut_EVENT_KIND_DETECTION: return "detection";
    case rheonaut_EVENT_KIND_DELIVERY_STARTED: return "delivery_started";
    case rheonaut_EVENT_KIND_DELIVERY_ENDED: return "delivery_ended";
    case rheonaut_EVENT_KIND_SENSOR_FAULT: return "sensor_fault";
    case rheonaut_EVENT_KIND_SENSOR_RECOVERED: return "sensor_recovered";
    case rheonaut_EVENT_KIND_LIMIT_HIT: return "limit_hit";
    case rheonaut_EVENT_KIND_CONTROLLER_CHANGED: return "controller_changed";
    case rheonaut_EVENT_KIND_PARAMETER_CHANGED: return "parameter_changed";
    case rheonaut_EVENT_KIND_POSITION_ZEROED: return "position_zeroed";
    case rheonaut_EVENT_KIND_MODEL_MISMATCH: return "model_mismatch";
    case rheonaut_EVENT_KIND_AUTO_LIMIT: return "auto_limit";
    case rheonaut_EVENT_KIND_TIME_STEP: return "time_step";
    case rheonaut_EVENT_KIND_MODEL_MISMATCH_ENDED: return "model_mismatch_ended";
    case rheonaut_EVENT_KIND_POSITION_UNCERTAIN: return "position_uncertain";
  }
  return "unknown";
}

const char* text(EventCause value) {
  switch (value) {
    case rheonaut_EVENT_CAUSE_NONE: return "none";
    case rheonaut_EVENT_CAUSE_COMMAND: return "command";
    case rheonaut_EVENT_CAUSE_LINK_LOSS: return "link_loss";
    case rheonaut_EVENT_CAUSE_IMPEDANCE: return "impedance";
    case rheonaut_EVENT_CAUSE_LIMIT: return "limit";
    case rheonaut_EVENT_CAUSE_SENSOR: return "sensor";
    case rheonaut_EVENT_CAUSE_INTERNAL: return "internal";
    case rheonaut_EVENT_CAUSE_RESET: return "reset";
    case rheonaut_EVENT_CAUSE_TIME: return "time";
    case rheonaut_EVENT_CAUSE_MOTOR_SUPPLY: return "motor_supply";
  }
  return "unknown";
}

const char* text(CommandResult value) {
  switch (value) {
    case rheonaut_COMMAND_RESULT_UNSPECIFIED: return "unspecified";
    case rheonaut_COMMAND_RESULT_ACCEPTED: return "accepted";
    case rheonaut_COMMAND_RESULT_REJECTED: return "rejected";
    case rheonaut_COMMAND_RESULT_EXPIRED: return "expired";
    case rheonaut_COMMAND_RESULT_DUPLICATE: return "duplicate";
    case rheonaut_COMMAND_RESULT_OTHER_BOOT: return "other_boot";
  }
  return "unknown";
}

const char* text(RejectReason value) {
  switch (value) {
    case rheonaut_REJECT_REASON_NONE: return "none";
    case rheonaut_REJECT_REASON_MALFORMED: return "malformed";
    case rheonaut_REJECT_REASON_NOT_FINITE: return "not_finite";
    case rheonaut_REJECT_REASON_OUT_OF_RANGE: return "out_of_range";
    case rheonaut_REJECT_REASON_WRONG_MODE: return "wrong_mode";
    case rheonaut_REJECT_REASON_LATCHED: return "latched";
    case rheonaut_REJECT_REASON_OTHER_EMERGENCY: return "other_emergency";
    case rheonaut_REJECT_REASON_CAUSE_STANDS: return "cause_stands";
    case rheonaut_REJECT_REASON_LIFE_TOO_LONG: return "life_too_long";
    case rheonaut_REJECT_REASON_NOTHING_TO_RENEW: return "nothing_to_renew";
    case rheonaut_REJECT_REASON_MOTOR_ON: return "motor_on";
    case rheonaut_REJECT_REASON_OUTWARD: return "outward";
    case rheonaut_REJECT_REASON_BUSY: return "busy";
    case rheonaut_REJECT_REASON_UNSTABLE: return "unstable";
    case rheonaut_REJECT_REASON_CHECKSUM: return "checksum";
    case rheonaut_REJECT_REASON_UNKNOWN_PARAMETER: return "unknown_parameter";
    case rheonaut_REJECT_REASON_UNSUPPORTED: return "unsupported";
    case rheonaut_REJECT_REASON_UNCERTAIN: return "uncertain";
  }
  return "unknown";
}

const char* text(RefusalReason value) {
  switch (value) {
    case rheonaut_REFUSAL_REASON_NONE: return "none";
    case rheonaut_REFUSAL_REASON_VERSION: return "version";
    case rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT: return "unknown_robot";
    case rheonaut_REFUSAL_REASON_WRONG_TOKEN: return "wrong_token";
    case rheonaut_REFUSAL_REASON_ALREADY_CONNECTED: return "already_connected";
    case rheonaut_REFUSAL_REASON_BOOT_ID_REUSED: return "boot_id_reused";
    case rheonaut_REFUSAL_REASON_MALFORMED: return "malformed";
    case rheonaut_REFUSAL_REASON_STATION_BUSY: return "station_busy";
  }
  return "unknown";
}

const char* kind(const Command& command) {
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag: return "set_mode";
    case rheonaut_Command_set_setpoint_tag: return "set_setpoint";
    case rheonaut_Command_set_duty_tag: return "set_duty";
    case rheonaut_Command_renew_lease_tag: return "renew_lease";
    case rheonaut_Command_set_duty_schedule_tag: return "set_duty_schedule";
    case rheonaut_Command_emergency_stop_tag: return "emergency_stop";
    case rheonaut_Command_clear_emergency_tag: return "clear_emergency";
    case rheonaut_Command_set_controller_tag: return "set_controller";
    case rheonaut_Command_restore_controller_tag: return "restore_controller";
    case rheonaut_Command_set_parameter_tag: return "set_parameter";
    case rheonaut_Command_get_parameters_tag: return "get_parameters";
    case rheonaut_Command_inject_disturbance_tag: return "inject_disturbance";
    case rheonaut_Command_zero_position_tag: return "zero_position";
    case rheonaut_Command_ping_tag: return "ping";
    case rheonaut_Command_drop_timed_tag: return "drop_timed";
    default: return "unknown";
  }
}

}  // namespace protocol
