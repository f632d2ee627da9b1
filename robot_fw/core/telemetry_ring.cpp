// Keeps samples and the segments they belong to.
#include "robot_fw/core/telemetry_ring.hpp"

#include <algorithm>

namespace robot_fw {

namespace {

// Float by float: the place may lie in memory that takes whole words only, and the library's memcpy, which the
// assignment of a whole sample may become, is free to move bytes.
void copy(const Sample& from, Sample& to) {
  to.position_m = from.position_m;
  to.velocity_m_s = from.velocity_m_s;
  to.acceleration_m_s2 = from.acceleration_m_s2;
  to.duty = from.duty;
  to.impedance_mv = from.impedance_mv;
  to.reference_m = from.reference_m;
}

}  // namespace

bool BatchValues::operator==(const BatchValues& other) const {
  return emergency_id == other.emergency_id && setpoint_m == other.setpoint_m && disturbance_m == other.disturbance_m &&
         position_sd_m == other.position_sd_m && controller_id == other.controller_id && flags == other.flags &&
         mode == other.mode && sub_state == other.sub_state && emergency_cause == other.emergency_cause &&
         has_setpoint == other.has_setpoint;
}

bool TelemetryRing::continues(const BatchValues& values, std::uint64_t robot_time_us, std::uint32_t period_us) const {
  if (next_segment_ == 0) return false;
  const Segment& last = segment(next_segment_ - 1);
  const std::uint64_t expected_us = last.first_robot_time_us + (next_seq_ - last.first_seq) * last.period_us;
  const std::uint64_t step_us = std::max(expected_us, robot_time_us) - std::min(expected_us, robot_time_us);
  return last.values == values && last.period_us == period_us && step_us * 4 <= period_us;  // less is jitter
}

bool TelemetryRing::push(const Sample& sample, const BatchValues& values, bool saturated, std::uint64_t robot_time_us,
                         std::uint32_t period_us) {
  std::uint64_t keep_from = oldest_seq_;
  if (fill() == kCapacity) keep_from = oldest_seq_ + 1;
  const bool starts_segment = !continues(values, robot_time_us, period_us);
  if (starts_segment && next_segment_ - oldest_segment_ == kMaxSegments) {
    keep_from = segment(oldest_segment_ + 1).first_seq;
  }
  lost_ += static_cast<std::uint32_t>(keep_from - oldest_seq_);
  forget_below(keep_from);
  if (starts_segment) segments_[next_segment_++ % kMaxSegments] = {next_seq_, robot_time_us, period_us, values};
  const auto at = static_cast<std::size_t>(next_seq_ % kCapacity);
  copy(sample, place(at));
  saturated_[at] = saturated;
  ++next_seq_;
  return starts_segment;
}

void TelemetryRing::acknowledge(std::uint64_t next_seq) {
  if (next_seq > next_seq_) return;
  acknowledged_next_seq_ = std::max(acknowledged_next_seq_, next_seq);
  if (next_seq > oldest_seq_) forget_below(next_seq);
}

void TelemetryRing::forget_below(std::uint64_t seq) {
  oldest_seq_ = seq;
  while (oldest_segment_ + 1 < next_segment_ && segment(oldest_segment_ + 1).first_seq <= seq) ++oldest_segment_;
}

void TelemetryRing::read(std::uint64_t first_seq, std::size_t max_samples, protocol::Telemetry& batch) const {
  std::uint64_t number = next_segment_ - 1;
  std::uint64_t end_seq = next_seq_;
  while (segment(number).first_seq > first_seq) end_seq = segment(number--).first_seq;
  const Segment& found = segment(number);
  const BatchValues& values = found.values;
  batch = rheonaut_Telemetry_init_zero;
  batch.first_seq = first_seq;
  batch.first_robot_time_us = found.first_robot_time_us + (first_seq - found.first_seq) * found.period_us;
  batch.period_us = found.period_us;
  batch.oldest_seq = oldest_seq_;
  batch.mode = static_cast<protocol::Mode>(values.mode);
  batch.sub_state = static_cast<protocol::SubState>(values.sub_state);
  batch.has_setpoint_m = values.has_setpoint;
  batch.setpoint_m = values.setpoint_m;
  batch.disturbance_m = values.disturbance_m;
  batch.position_sd_m = values.position_sd_m;
  batch.controller_id = values.controller_id;
  batch.emergency_id = values.emergency_id;
  batch.flags = values.flags;
  batch.emergency_cause = static_cast<protocol::EmergencyCause>(values.emergency_cause);

  const auto count = static_cast<pb_size_t>(
      std::min<std::uint64_t>({end_seq - first_seq, max_samples, protocol::kMaxSamplesPerFrame}));
  auto at = static_cast<std::size_t>(first_seq % kCapacity);
  for (pb_size_t i = 0; i < count; ++i) {
    const Sample& sample = place(at);
    batch.position_m[i] = sample.position_m;
    batch.velocity_m_s[i] = sample.velocity_m_s;
    batch.acceleration_m_s2[i] = sample.acceleration_m_s2;
    batch.duty[i] = sample.duty;
    batch.impedance_mv[i] = sample.impedance_mv;
    batch.reference_m[i] = sample.reference_m;
    if (saturated_[at]) batch.flags |= rheonaut_TELEMETRY_FLAG_SATURATED;
    at = at + 1 == kCapacity ? 0 : at + 1;  // a division of 64 bits costs a robot as much as the rest
  }
  batch.position_m_count = batch.velocity_m_s_count = batch.acceleration_m_s2_count = count;
  batch.duty_count = batch.impedance_mv_count = batch.reference_m_count = count;
}

}  // namespace robot_fw
