// The commands of one robot, in lists by what they wait for: an answer, telemetry, a report, or nothing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "server/station/commands/pending_command.hpp"

namespace server::station {

struct RobotCommands {
  static constexpr std::size_t kMaxWaiting = 64;  // of each of the queues; the oldest leave

  std::map<CommandId, std::shared_ptr<PendingCommand>> unanswered;  // by a robot; queued or sent
  std::deque<std::shared_ptr<PendingCommand>> unseen;   // acknowledged, to be seen in telemetry; oldest first
  std::deque<std::shared_ptr<PendingCommand>> unread;   // acknowledged, to be read back; oldest first
  std::deque<std::shared_ptr<PendingCommand>> unknown;  // of this boot, ended in this state; oldest first
  std::uint64_t last_number = 0;
  // While a stop is handed to the link: takes the records of what the link sends meanwhile, instead of the sinks.
  std::vector<CommandRecord>* sent_with_stop = nullptr;

  bool is_empty() const { return unanswered.empty() && unseen.empty() && unread.empty(); }
  // Numbers it in the order of submission; it waits for its answer from now on.
  void add(const std::shared_ptr<PendingCommand>& pending);
  std::shared_ptr<PendingCommand> find_unanswered(CommandId id) const;  // null when it is none of them
  std::shared_ptr<PendingCommand> take_unanswered(CommandId id);        // the same, and removes it
  // Those of the unanswered that are no stop and still wait for the link.
  std::vector<CommandId> queued() const;

  // Stops that no robot has acknowledged; the newest, null when there is none, and how many there are.
  std::shared_ptr<PendingCommand> newest_stop() const;
  std::size_t stops() const;

  // That waits for an answer, for telemetry or for a report; null when it is none of them.
  std::shared_ptr<PendingCommand> on_its_way(CommandId id) const;
  // One that ended without an answer is kept, since telemetry may still show its effect.
  void keep_unknown(std::shared_ptr<PendingCommand> ended);
  // One whose end was unknown waits for its answer again; null when it is not one of those.
  std::shared_ptr<PendingCommand> reopen(CommandId id);
  // Those that are read back and that the robot may have run, also without an answer yet; in the order in which they
  // were sent.
  std::vector<std::shared_ptr<PendingCommand>> to_be_read_back() const;
};

}  // namespace server::station
