// Checks the identity and time of commands, and holds the timed commands until they are due.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/messages.hpp"

namespace robot_fw {

struct Verdict {
  protocol::CommandResult result = rheonaut_COMMAND_RESULT_ACCEPTED;
  protocol::RejectReason reason = rheonaut_REJECT_REASON_NONE;

  bool accepted() const { return result == rheonaut_COMMAND_RESULT_ACCEPTED; }
};

constexpr Verdict kAccepted{};
constexpr Verdict kTimedExpired{rheonaut_COMMAND_RESULT_EXPIRED};  // a timed command whose lease has lapsed
constexpr Verdict rejected(protocol::RejectReason reason) { return {rheonaut_COMMAND_RESULT_REJECTED, reason}; }

// Admits each command once, for this boot, within its time to live. Does not check modes.
class CommandFilter {
 public:
  explicit CommandFilter(std::uint64_t boot_id) : boot_id_(boot_id) {}

  Verdict admit(const protocol::Command& command, std::uint64_t now_us);

  // Remembers an id; false when it was known.
  bool remember(std::uint64_t command_id);

 private:
  std::uint64_t boot_id_;
  std::array<std::uint64_t, 64> recent_{};
  std::size_t oldest_ = 0;
};

// Admitted commands whose time is still to come, encoded one behind the other in order of arrival.
//
// SAFETY: they wait under a lease, in every mode: their sender must keep renewing it.
class TimedCommands {
 public:
  static constexpr std::size_t kMaxCommands = 4;
  static constexpr std::size_t kMaxBytes = 496;  // of all; a schedule of 64 entries with ticks below 2 million fits

  // False when there is no room. Renews the lease of all that wait, since their sender is there.
  bool hold(const protocol::Command& command, std::uint64_t now_us);
  // Extends that lease; false when nothing waits, or when it has lapsed.
  bool renew_lease(std::uint32_t lease_ms, std::uint64_t now_us);
  bool lease_lapsed(std::uint64_t now_us) const { return size_bytes_[0] > 0 && now_us >= lease_until_us_; }
  // Removes and returns the earliest command due at `now_us`; of several for the same time, the first to arrive.
  std::optional<protocol::Command> take_due(std::uint64_t now_us);
  // Drops one command and returns its id; empty when none is left.
  std::optional<std::uint64_t> drop_any();

 private:
  std::size_t earliest_due(std::uint64_t now_us) const;  // kMaxCommands: none
  void remove(std::size_t index);
  std::size_t first_byte(std::size_t index) const;

  struct Held {
    std::uint64_t execute_at_robot_us;
    std::uint64_t command_id;
  };
  std::array<Held, kMaxCommands> held_{};
  std::array<std::uint16_t, kMaxCommands> size_bytes_{};  // of each; 0 behind the last
  std::array<std::uint8_t, kMaxBytes> bytes_{};
  std::uint64_t lease_until_us_ = 0;  // while something waits
};

}  // namespace robot_fw
