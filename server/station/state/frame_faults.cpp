// Numbers that are too large or not finite.
#include "server/station/state/frame_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/station/state/telemetry_fields.hpp"

namespace server::station {
namespace {

std::uint64_t reach_from(std::uint64_t number, std::uint64_t leap) { return std::min(number + leap, kMaxRobotNumber); }

void add(FrameFaults& faults, const char* cause, std::string words) {
  if (faults.count++ > 0) return;
  faults.cause = cause;
  faults.first = std::move(words);
}

// True when the oldest number that a robot says it still has is above one that it sends: then it says nothing.
bool is_above_its_own(FrameFaults& faults, const char* field, std::uint64_t oldest, std::uint64_t own) {
  if (oldest <= own) return false;
  add(faults, "out_of_range", fmt::format("{} is {}, above {}, which the robot has just sent", field, oldest, own));
  return true;
}

// True when the number is beyond what it can be.
bool is_too_large(FrameFaults& faults, const char* field, std::uint64_t value, std::uint64_t most) {
  if (value <= most) return false;
  add(faults, "out_of_range", fmt::format("{} is {}, it can be at most {}", field, value, most));
  return true;
}

void check_finite(FrameFaults& faults, const char* field, float value, std::uint64_t seq) {
  if (std::isfinite(value)) return;
  add(faults, "not_finite", fmt::format("{} is {} from sample {} on; NULL is stored", field, value, seq));
}

void mend(protocol::Telemetry& batch, const FrameReach& reach, FrameFaults& faults) {
  if (is_too_large(faults, "first_seq", batch.first_seq, reach.first_seq(batch))) {
    faults.is_unusable = true;
    faults.has_number = false;
    return;
  }
  if (is_above_its_own(faults, "oldest_seq", batch.oldest_seq, batch.first_seq)) batch.oldest_seq = 0;
  if (is_too_large(faults, "first_robot_time_us", batch.first_robot_time_us, reach.robot_time_us))
    faults.is_unusable = true;
  if (batch.period_us == 0 || batch.period_us > kMaxPeriodUs) {
    add(faults, "out_of_range",
        fmt::format("period_us is {} from sample {} on, it must be 1 to {}", batch.period_us, batch.first_seq,
                    kMaxPeriodUs));
    faults.is_unusable = true;
  }
  for_each_batch_field_of<FieldKind::number>([&](const auto& field) {
    const bool is_there = field.has == nullptr || batch.*field.has;
    if (is_there) check_finite(faults, field.name, batch.*field.wire, batch.first_seq);
  });
}

void mend(protocol::Event& event, const FrameReach& reach, FrameFaults& faults) {
  if (is_too_large(faults, "event_seq", event.event_seq, reach.event_seq)) faults.has_number = false;
  if (is_above_its_own(faults, "oldest_event_seq", event.oldest_event_seq, event.event_seq)) event.oldest_event_seq = 0;
  const bool has_time = !is_too_large(faults, "event_robot_time_us", event.event_robot_time_us, reach.robot_time_us);
  const bool has_sample = !is_too_large(faults, "sample_seq", event.sample_seq, reach.sample_seq());
  faults.is_unusable = !faults.has_number || !has_time || !has_sample;
}

}  // namespace

FrameReach FrameReach::after(const protocol::Hello& hello, std::uint64_t robot_time_us) {
  return {.next_seq = hello.next_seq,
          .sampled_at_us = robot_time_us,
          .event_seq = reach_from(hello.next_event_seq, kEventLeap),
          .robot_time_us = reach_from(robot_time_us, kTimeLeapUs)};
}

void FrameReach::advance(const protocol::RobotFrame& frame) {
  robot_time_us = std::max(robot_time_us, reach_from(frame.robot_time_us, kTimeLeapUs));
  if (frame.which_body == rheonaut_RobotFrame_telemetry_tag) {
    const protocol::Telemetry& batch = frame.body.telemetry;
    next_seq = std::max(next_seq, batch.first_seq + batch.position_m_count);
    if (batch.first_robot_time_us <= robot_time_us) sampled_at_us = std::max(sampled_at_us, batch.first_robot_time_us);
  } else if (frame.which_body == rheonaut_RobotFrame_event_tag) {
    event_seq = std::max(event_seq, reach_from(frame.body.event.event_seq, kEventLeap));
  }
}

// A time or a period that cannot be says nothing of how many samples were made.
std::uint64_t FrameReach::first_seq(const protocol::Telemetry& batch) const {
  const std::uint64_t time_us = batch.first_robot_time_us;
  const bool has_time = time_us > sampled_at_us && time_us <= robot_time_us;
  const bool has_period = batch.period_us > 0 && batch.period_us <= kMaxPeriodUs;
  const std::uint64_t made = has_time && has_period ? (time_us - sampled_at_us) / batch.period_us : 0;
  return reach_from(next_seq, made + kSeqSlack);
}

std::uint64_t FrameReach::sample_seq() const { return reach_from(next_seq, kEventLeap); }

FrameFaults mend(protocol::RobotFrame& frame, const FrameReach& reach) {
  FrameFaults faults;
  const bool has_no_time = is_too_large(faults, "robot_time_us", frame.robot_time_us, reach.robot_time_us);
  if (has_no_time) frame.robot_time_us = 0;
  switch (frame.which_body) {
    case rheonaut_RobotFrame_telemetry_tag:
      mend(frame.body.telemetry, reach, faults);
      if (!faults.is_unusable) faults.samples = Checked<protocol::Telemetry>{frame.body.telemetry};
      break;
    case rheonaut_RobotFrame_event_tag:
      mend(frame.body.event, reach, faults);
      if (!faults.is_unusable) faults.event = Checked<protocol::Event>{frame.body.event};
      break;
    case rheonaut_RobotFrame_heartbeat_tag: {
      protocol::Heartbeat& answer = frame.body.heartbeat;
      const bool is_no_time =
          is_too_large(faults, "echo_received_at_robot_us", answer.echo_received_at_robot_us, reach.robot_time_us);
      if (has_no_time || is_no_time) answer = rheonaut_Heartbeat_init_zero;  // a sign of life, and no answer
      break;
    }
    default: break;
  }
  return faults;
}

}  // namespace server::station
