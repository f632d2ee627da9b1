// Numbers that are too large or not finite.
#include "server/link/frame_faults.hpp"

#include <cmath>

namespace server {
namespace {

constexpr std::uint32_t kMaxPeriodUs = 10'000'000;

const char* fault_of(const protocol::Telemetry& batch) {
  if (batch.first_seq > kMaxNumber || batch.oldest_seq > kMaxNumber) return "a sample number beyond 2^62";
  if (batch.first_robot_time_us > kMaxNumber) return "a time beyond 2^62 µs";
  if (batch.period_us == 0 || batch.period_us > kMaxPeriodUs) return "a sample period outside 1 µs to 10 s";
  const bool finite = std::isfinite(batch.disturbance_m) && std::isfinite(batch.position_sd_m) &&
                      (!batch.has_setpoint_m || std::isfinite(batch.setpoint_m));
  return finite ? nullptr : "a setpoint, disturbance or standard deviation that is not a number";
}

}  // namespace

const char* fault_of(const protocol::RobotFrame& frame) {
  if (frame.robot_time_us > kMaxNumber) return "a time beyond 2^62 µs";
  switch (frame.which_body) {
    case rheonaut_RobotFrame_hello_tag: return "a second hello on one connection";
    case rheonaut_RobotFrame_telemetry_tag: return fault_of(frame.body.telemetry);
    case rheonaut_RobotFrame_event_tag: {
      const protocol::Event& event = frame.body.event;
      const bool possible = event.event_seq <= kMaxNumber && event.oldest_event_seq <= kMaxNumber &&
                            event.event_robot_time_us <= kMaxNumber && event.sample_seq <= kMaxNumber;
      return possible ? nullptr : "an event with a number or time beyond 2^62";
    }
    case rheonaut_RobotFrame_heartbeat_tag:
      return frame.body.heartbeat.echo_received_at_robot_us <= kMaxNumber ? nullptr : "a time beyond 2^62 µs";
    default: return nullptr;
  }
}

}  // namespace server
