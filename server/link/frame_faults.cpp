// Numbers that are too large or not finite.
#include "server/link/frame_faults.hpp"

#include <fmt/format.h>

#include <cmath>

namespace server {
namespace {

constexpr std::uint32_t kMaxPeriodUs = 10'000'000;

void add(FrameFaults& faults, const char* cause, std::string words) {
  if (faults.count++ > 0) return;
  faults.cause = cause;
  faults.first = std::move(words);
}

// True when the number is beyond 2^62.
bool is_too_large(FrameFaults& faults, const char* field, std::uint64_t value) {
  if (value <= kMaxNumber) return false;
  add(faults, "out_of_range", fmt::format("{} is {}, which is beyond 2^62", field, value));
  return true;
}

void check_finite(FrameFaults& faults, const char* field, float value, std::uint64_t seq) {
  if (std::isfinite(value)) return;
  add(faults, "not_finite", fmt::format("{} is {} from sample {} on; NULL is stored", field, value, seq));
}

void mend(protocol::Telemetry& batch, FrameFaults& faults) {
  if (is_too_large(faults, "oldest_seq", batch.oldest_seq)) batch.oldest_seq = 0;
  if (is_too_large(faults, "first_seq", batch.first_seq)) {
    faults.is_unusable = true;
    faults.has_number = false;
    return;
  }
  if (is_too_large(faults, "first_robot_time_us", batch.first_robot_time_us)) faults.is_unusable = true;
  if (batch.period_us == 0 || batch.period_us > kMaxPeriodUs) {
    add(faults, "out_of_range",
        fmt::format("period_us is {} from sample {} on, it must be 1 to {}", batch.period_us, batch.first_seq,
                    kMaxPeriodUs));
    faults.is_unusable = true;
  }
  if (batch.has_setpoint_m) check_finite(faults, "setpoint_m", batch.setpoint_m, batch.first_seq);
  check_finite(faults, "disturbance_m", batch.disturbance_m, batch.first_seq);
  check_finite(faults, "position_sd_m", batch.position_sd_m, batch.first_seq);
}

void mend(protocol::Event& event, FrameFaults& faults) {
  if (is_too_large(faults, "oldest_event_seq", event.oldest_event_seq)) event.oldest_event_seq = 0;
  if (is_too_large(faults, "event_seq", event.event_seq)) faults.has_number = false;
  const bool has_time = !is_too_large(faults, "event_robot_time_us", event.event_robot_time_us);
  const bool has_sample = !is_too_large(faults, "sample_seq", event.sample_seq);
  faults.is_unusable = !faults.has_number || !has_time || !has_sample;
}

}  // namespace

FrameFaults mend(protocol::RobotFrame& frame) {
  FrameFaults faults;
  const bool has_no_time = is_too_large(faults, "robot_time_us", frame.robot_time_us);
  if (has_no_time) frame.robot_time_us = 0;
  switch (frame.which_body) {
    case rheonaut_RobotFrame_telemetry_tag: mend(frame.body.telemetry, faults); break;
    case rheonaut_RobotFrame_event_tag: mend(frame.body.event, faults); break;
    case rheonaut_RobotFrame_heartbeat_tag: {
      protocol::Heartbeat& answer = frame.body.heartbeat;
      const bool is_no_time = is_too_large(faults, "echo_received_at_robot_us", answer.echo_received_at_robot_us);
      if (has_no_time || is_no_time) answer = rheonaut_Heartbeat_init_zero;  // a sign of life, and no answer
      break;
    }
    default: break;
  }
  return faults;
}

}  // namespace server
