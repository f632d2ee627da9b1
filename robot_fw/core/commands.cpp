// Checks identity and time, and keeps timed commands.
#include "robot_fw/core/commands.hpp"

#include <algorithm>

namespace robot_fw {

Verdict CommandGate::admit(const protocol::Command& command, std::uint64_t now_us) {
  if (command.command_id == 0 || command.which_action == 0) return rejected(rheonaut_REJECT_REASON_MALFORMED);
  if (command.boot_id != boot_id_) return {rheonaut_COMMAND_RESULT_OTHER_BOOT};   // SAFETY: meant for an earlier life
  if (!remember(command.command_id)) return {rheonaut_COMMAND_RESULT_DUPLICATE};  // SAFETY: nothing runs twice
  if (now_us > command.valid_until_robot_us) return {rheonaut_COMMAND_RESULT_EXPIRED};  // SAFETY: nothing stale moves
  if (command.valid_until_robot_us - now_us > protocol::kMaxCommandLifeUs) {
    return rejected(rheonaut_REJECT_REASON_LIFE_TOO_LONG);  // SAFETY: such a clock cannot be right
  }
  if (command.has_execute_at_robot_us && command.execute_at_robot_us > command.valid_until_robot_us) {
    return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  }
  return kAccepted;
}

bool CommandGate::remember(std::uint64_t command_id) {
  if (std::find(recent_.begin(), recent_.end(), command_id) != recent_.end()) return false;
  recent_[oldest_] = command_id;
  oldest_ = (oldest_ + 1) % recent_.size();
  return true;
}

bool TimedCommands::hold(const protocol::Command& command) {
  for (std::size_t i = 0; i < held_.size(); ++i) {
    if (used_[i]) continue;
    held_[i] = command;
    used_[i] = true;
    return true;
  }
  return false;
}

bool TimedCommands::take_due(std::uint64_t now_us, protocol::Command& command) {
  std::size_t earliest = held_.size();
  for (std::size_t i = 0; i < held_.size(); ++i) {
    if (!used_[i] || held_[i].execute_at_robot_us > now_us) continue;
    if (earliest == held_.size() || held_[i].execute_at_robot_us < held_[earliest].execute_at_robot_us) earliest = i;
  }
  if (earliest == held_.size()) return false;
  command = held_[earliest];
  used_[earliest] = false;
  return true;
}

}  // namespace robot_fw
