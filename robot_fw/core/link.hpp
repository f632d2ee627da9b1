// The state of the link to the station: greeting, time of the last frame, loss.
//
// A link is not a connection. It is lost only by silence, and a new connection within the time-out carries it on.
//   closed --opened--> greeting --welcome--> up --closed--> closed
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/frame.hpp"

namespace robot_fw {

class Link {
 public:
  enum class Phase { closed, greeting, up };

  void opened(std::uint64_t now_us);
  void closed() { phase_ = Phase::closed; }
  // Uses the station's time-outs, within bounds; the link is up from now on.
  void welcomed(const protocol::Welcome& welcome, std::uint32_t default_timeout_ms, std::uint64_t now_us);
  // Any frame of a link that is up. Returns the seconds without link when this restores a lost one.
  std::optional<float> frame_received(std::uint64_t now_us);
  // The bytes of this connection, see FrameReader.
  protocol::FrameReader::State push(protocol::Bytes& bytes) { return reader_.push(bytes); }
  protocol::Bytes payload() const { return reader_.payload(); }
  // Once per tick: true in the tick in which the link is found to be lost.
  bool goes_lost(std::uint64_t now_us);
  void sent(std::uint64_t now_us) { sent_at_us_ = now_us; }

  Phase phase() const { return phase_; }
  bool up() const { return phase_ == Phase::up; }
  bool lost() const { return lost_; }
  bool heartbeat_due(std::uint64_t now_us) const { return now_us >= sent_at_us_ + heartbeat_interval_us_; }
  // Nothing arrived over this connection for the time-out: its owner should close it and dial again.
  bool connection_is_silent(std::uint64_t now_us) const;
  std::uint32_t samples_per_frame(std::uint32_t preferred) const {
    return samples_per_frame_ == 0 ? preferred : samples_per_frame_;
  }

 private:
  Phase phase_ = Phase::closed;
  bool established_ = false;  // was up once in this boot
  bool lost_ = false;
  std::uint64_t received_at_us_ = 0;    // last frame of a link that was up
  std::uint64_t connection_at_us_ = 0;  // opened, or last frame on this connection
  std::uint64_t sent_at_us_ = 0;
  std::uint64_t timeout_us_ = protocol::kDefaultLinkTimeoutMs * 1000ULL;
  std::uint64_t heartbeat_interval_us_ = protocol::kDefaultHeartbeatIntervalMs * 1000ULL;
  std::uint32_t samples_per_frame_ = 0;  // 0: the station leaves it to the robot
  protocol::FrameReader reader_;
};

}  // namespace robot_fw
