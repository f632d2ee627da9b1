// Checks identity and time, and keeps timed commands.
#include "robot_fw/core/commands.hpp"

#include <algorithm>
#include <numeric>

namespace robot_fw {

Verdict CommandFilter::admit(const protocol::Command& command, std::uint64_t now_us) {
  if (command.command_id == 0 || command.which_action == 0) return rejected(rheonaut_REJECT_REASON_MALFORMED);
  if (command.boot_id != boot_id_) return {rheonaut_COMMAND_RESULT_OTHER_BOOT};   // SAFETY: meant for an earlier boot
  if (!remember(command.command_id)) return {rheonaut_COMMAND_RESULT_DUPLICATE};  // SAFETY: nothing runs twice
  if (now_us > command.valid_until_robot_us) return {rheonaut_COMMAND_RESULT_EXPIRED};  // SAFETY: nothing stale moves
  if (command.valid_until_robot_us - now_us > protocol::kMaxTimeToLiveUs) {
    return rejected(rheonaut_REJECT_REASON_LIFE_TOO_LONG);  // SAFETY: such a clock cannot be right
  }
  if (command.has_execute_at_robot_us && command.execute_at_robot_us > command.valid_until_robot_us) {
    return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  }
  return kAccepted;
}

bool CommandFilter::remember(std::uint64_t command_id) {
  if (std::find(recent_.begin(), recent_.end(), command_id) != recent_.end()) return false;
  recent_[oldest_] = command_id;
  oldest_ = (oldest_ + 1) % recent_.size();
  return true;
}

bool TimedCommands::hold(const protocol::Command& command, std::uint64_t now_us) {
  const auto free = std::find(size_bytes_.begin(), size_bytes_.end(), 0);
  if (free == size_bytes_.end()) return false;
  const auto index = static_cast<std::size_t>(free - size_bytes_.begin());
  const std::size_t first = first_byte(index);
  const std::size_t size = protocol::encode(command, bytes_.data() + first, kMaxBytes - first);
  if (size == 0) return false;
  size_bytes_[index] = static_cast<std::uint16_t>(size);
  held_[index] = {command.execute_at_robot_us, command.command_id};
  lease_until_us_ = now_us + std::uint64_t{protocol::kLeaseMs} * 1000;
  return true;
}

bool TimedCommands::renew_lease(std::uint32_t lease_ms, std::uint64_t now_us) {
  if (size_bytes_[0] == 0 || lease_lapsed(now_us)) return false;  // SAFETY: what has lapsed stays lapsed
  lease_until_us_ = now_us + std::uint64_t{lease_ms == 0 ? protocol::kLeaseMs : lease_ms} * 1000;
  return true;
}

std::size_t TimedCommands::earliest_due(std::uint64_t now_us) const {
  std::size_t earliest = kMaxCommands;
  for (std::size_t i = 0; i < kMaxCommands && size_bytes_[i] > 0; ++i) {
    const std::uint64_t at_us = held_[i].execute_at_robot_us;
    if (at_us <= now_us && (earliest == kMaxCommands || at_us < held_[earliest].execute_at_robot_us)) earliest = i;
  }
  return earliest;
}

std::optional<protocol::Command> TimedCommands::take_due(std::uint64_t now_us) {
  const std::size_t index = earliest_due(now_us);
  const bool is_due = index < kMaxCommands;
  auto command = is_due ? protocol::decode_command({bytes_.data() + first_byte(index), size_bytes_[index]})
                        : std::optional<protocol::Command>{};
  if (is_due) remove(index);
  return command;
}

std::optional<std::uint64_t> TimedCommands::drop_any() {
  if (size_bytes_[0] == 0) return std::nullopt;
  const std::uint64_t command_id = held_[0].command_id;
  remove(0);
  return command_id;
}

// Those behind it move up.
void TimedCommands::remove(std::size_t index) {
  const std::size_t first = first_byte(index);
  std::copy(bytes_.begin() + first + size_bytes_[index], bytes_.end(), bytes_.begin() + first);
  std::copy(held_.begin() + index + 1, held_.end(), held_.begin() + index);
  std::copy(size_bytes_.begin() + index + 1, size_bytes_.end(), size_bytes_.begin() + index);
  size_bytes_.back() = 0;
}

std::size_t TimedCommands::first_byte(std::size_t index) const {
  return std::accumulate(size_bytes_.begin(), size_bytes_.begin() + index, std::size_t{0});
}

}  // namespace robot_fw
