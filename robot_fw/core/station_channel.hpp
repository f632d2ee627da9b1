// The exchange with the station: the link, the samples and events that it may still request, and the next due frame.
//
//   in    push() until a frame is complete, frame() decodes it; the owner acts on it
//   out   next() names the first due frame, fill() fills the kinds that this part knows, sent() confirms it
// Samples and events are kept, with or without a link, until a Welcome or heartbeat reports that they are on disk.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/frame.hpp"
#include "robot_fw/core/event_ring.hpp"
#include "robot_fw/core/link.hpp"
#include "robot_fw/core/outbox.hpp"
#include "robot_fw/core/telemetry_ring.hpp"

namespace robot_fw {

class StationChannel {
 public:
  // The station may ask for another number of samples a frame.
  explicit StationChannel(std::uint32_t samples_per_frame) : preferred_samples_(samples_per_frame) {}

  void opened(std::uint64_t now_us) {
    refusal_ = rheonaut_REFUSAL_REASON_NONE;
    refusal_detail_[0] = '\0';
    link_.opened(now_us);
    outbox_.opened();
  }
  void closed() { link_.closed(); }

  // Takes bytes from the front of `bytes` up to the end of the next frame.
  protocol::FrameReader::State push(protocol::Bytes& bytes) {
    const auto state = link_.push(bytes);
    if (state == protocol::FrameReader::State::oversize) ++bad_frames_;
    return state;
  }
  // The frame that push() completed; nothing when it does not decode.
  std::optional<protocol::StationFrame> frame();
  // Takes over the station's times: the link is up. False when the station refuses, or speaks another version.
  bool accept(const protocol::Welcome& welcome, std::uint32_t default_timeout_ms, std::uint64_t now_us);
  // After accept(): what the rings hold and the station lacks is due again.
  void resume(const protocol::Welcome& welcome) {
    samples_.acknowledge(welcome.durable_next_seq);
    events_.acknowledge(welcome.durable_next_event_seq);
    outbox_.welcomed(samples_, events_);
  }
  // Any frame of a link that is up. The seconds without link when this restores a lost one.
  std::optional<float> frame_received(std::uint64_t now_us) { return link_.frame_received(now_us); }
  void on_heartbeat(const protocol::StationHeartbeat& heartbeat, std::uint64_t now_us);

  // Once per tick. A sample leaves at once, with all before it, when a batch value changed or something happened.
  void push(const Sample& sample, const BatchValues& values, bool saturated, std::uint64_t now_us,
            std::uint32_t period_us) {
    const bool changed = samples_.push(sample, values, saturated, now_us, period_us);
    outbox_.sample_made(samples_, changed || is_urgent_);
    is_urgent_ = false;
  }
  void push(const protocol::Event& event) {
    events_.push(event);
    is_urgent_ = true;
  }
  void hurry() { is_urgent_ = true; }  // something happened: the next sample leaves at once

  Outgoing next(std::uint64_t now_us) { return outbox_.next(link_, samples_, events_, samples_per_frame(), now_us); }
  // An ack, event, heartbeat or batch of samples; hello, status, parameters and controller are filled by their owner.
  void fill(Outgoing what, protocol::RobotFrame& frame) const;
  void sent(Outgoing what, std::size_t samples_in_frame, std::uint64_t now_us) {
    outbox_.sent(what, samples_in_frame, now_us);
    link_.sent(now_us);
  }

  // Once per tick: true in the tick in which the link is found to be lost.
  bool goes_lost(std::uint64_t now_us) { return link_.goes_lost(now_us); }

  Outbox& outbox() { return outbox_; }
  const Outbox& outbox() const { return outbox_; }
  const Link& link() const { return link_; }
  const TelemetryRing& samples() const { return samples_; }
  const EventRing& events() const { return events_; }
  protocol::RefusalReason refusal() const { return refusal_; }
  const char* refusal_detail() const { return refusal_detail_.data(); }
  std::uint32_t bad_frames() const { return bad_frames_; }
  std::uint32_t commands_received() const { return commands_received_; }

 private:
  std::uint32_t samples_per_frame() const { return link_.samples_per_frame(preferred_samples_); }

  std::uint32_t preferred_samples_;
  std::uint32_t bad_frames_ = 0;
  std::uint32_t commands_received_ = 0;
  bool is_urgent_ = false;  // something happened since the last sample
  protocol::RefusalReason refusal_ = rheonaut_REFUSAL_REASON_NONE;
  std::array<char, 64> refusal_detail_{};
  Outbox outbox_;
  EventRing events_;
  Link link_;
  TelemetryRing samples_;
};

}  // namespace robot_fw
