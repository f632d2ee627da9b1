// Which commands may run: the check of identity and time, and the few that wait for their time.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw {

struct Verdict {
  protocol::CommandResult result = rheonaut_COMMAND_RESULT_ACCEPTED;
  protocol::RejectReason reason = rheonaut_REJECT_REASON_NONE;

  bool accepted() const { return result == rheonaut_COMMAND_RESULT_ACCEPTED; }
};

constexpr Verdict kAccepted{};
constexpr Verdict rejected(protocol::RejectReason reason) { return {rheonaut_COMMAND_RESULT_REJECTED, reason}; }

// Lets each command through once, for this boot, within its life. Says nothing about modes.
class CommandGate {
 public:
  explicit CommandGate(std::uint64_t boot_id) : boot_id_(boot_id) {}

  Verdict admit(const protocol::Command& command, std::uint64_t now_us);

  // Remembers an id; false when it was known.
  bool remember(std::uint64_t command_id);

 private:
  std::uint64_t boot_id_;
  std::array<std::uint64_t, 64> recent_{};
  std::size_t oldest_ = 0;
};

// Commands admitted with a time still to come.
class TimedCommands {
 public:
  // False when no place is free.
  bool hold(const protocol::Command& command);
  // Takes the earliest one due at `now_us` out into `command`; false when none is.
  bool take_due(std::uint64_t now_us, protocol::Command& command);
  // Takes any one out; false when none is left.
  bool take_any(protocol::Command& command) { return take_due(UINT64_MAX, command); }

 private:
  std::array<protocol::Command, 4> held_{};
  std::array<bool, 4> used_{};
};

}  // namespace robot_fw
