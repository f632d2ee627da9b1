// Follows the link through its phases.
#include "robot_fw/core/link.hpp"

#include <algorithm>

namespace robot_fw {
namespace {

constexpr std::uint32_t kMinLinkTimeoutMs = 100, kMaxLinkTimeoutMs = 5000;
constexpr std::uint32_t kMinHeartbeatIntervalMs = 10;

std::uint64_t elapsed_us(std::uint64_t from_us, std::uint64_t now_us) {
  return now_us > from_us ? now_us - from_us : 0;
}

}  // namespace

void Link::opened(std::uint64_t now_us) {
  reader_.reset();
  phase_ = Phase::greeting;
  connection_at_us_ = now_us;
}

void Link::welcomed(const protocol::Welcome& welcome, std::uint32_t default_timeout_ms, std::uint64_t now_us) {
  phase_ = Phase::up;
  const auto or_default = [](std::uint32_t asked, std::uint32_t preset) { return asked == 0 ? preset : asked; };
  // SAFETY: whatever the station asks for, silence is noticed within 5 s.
  const std::uint32_t timeout_ms =
      std::clamp(or_default(welcome.link_timeout_ms, default_timeout_ms), kMinLinkTimeoutMs, kMaxLinkTimeoutMs);
  const std::uint32_t interval_ms =
      std::clamp(or_default(welcome.heartbeat_interval_ms, protocol::kDefaultHeartbeatIntervalMs),
                 kMinHeartbeatIntervalMs, timeout_ms / 2);
  timeout_us_ = timeout_ms * 1000ULL;
  heartbeat_interval_us_ = interval_ms * 1000ULL;
  samples_per_frame_ = std::min(welcome.samples_per_frame, static_cast<std::uint32_t>(protocol::kMaxSamplesPerFrame));
  sent_at_us_ = now_us;
}

std::optional<float> Link::frame_received(std::uint64_t now_us) {
  connection_at_us_ = now_us;
  const std::uint64_t silence_us = elapsed_us(received_at_us_, now_us);
  received_at_us_ = now_us;
  established_ = true;
  if (!lost_) return std::nullopt;
  lost_ = false;
  return static_cast<float>(silence_us) * 1e-6F;
}

bool Link::goes_lost(std::uint64_t now_us) {
  if (!established_ || lost_ || elapsed_us(received_at_us_, now_us) <= timeout_us_) return false;
  lost_ = true;
  return true;
}

bool Link::connection_is_silent(std::uint64_t now_us) const {
  return phase_ != Phase::closed && elapsed_us(connection_at_us_, now_us) > timeout_us_;
}

}  // namespace robot_fw
