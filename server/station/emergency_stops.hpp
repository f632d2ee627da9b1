// Sends emergency stops to robots: ahead of everything, kept until the robot has obeyed, repeated while it has not.
//
// Publishes nothing: records are appended to the caller's list, so that the frames of all robots can be sent before
// anything is recorded. Loop thread.
#pragma once

#include <boost/asio/io_context.hpp>
#include <memory>
#include <utility>
#include <vector>

#include "server/station/commands/recent_commands.hpp"
#include "server/station/robot_entry.hpp"

namespace server::station {

class EmergencyStops {
 public:
  EmergencyStops(boost::asio::io_context& loop, runtime::Clock& clock, RecentCommands& recent)
      : loop_{loop}, clock_{clock}, recent_{recent} {}

  // Hands a stop to the link, or finds the one that is the answer to the request already; nothing is to be published
  // then. What the link throws reaches the caller; the stop is kept all the same.
  std::shared_ptr<PendingCommand> begin(RobotEntry& entry, const StopRequest& request,
                                        std::vector<CommandRecord>& to_publish);
  // The stop that answers the request already; null when a new one is needed.
  std::shared_ptr<PendingCommand> stop_in_force(RobotEntry& entry, const StopRequest& request);

  // The robot has connected. SAFETY: a stop that no robot has acknowledged goes first; a robot that `lost_its_latch` in
  // a reset is latched again.
  void on_connected(RobotEntry& entry, bool lost_its_latch, std::vector<CommandRecord>& to_publish);
  // SAFETY: a stop that a connected robot leaves unanswered is sent again each second, under the same id.
  void repeat(RobotEntry& entry, std::vector<CommandRecord>& to_publish);
  // Takes over a stop of an earlier run of the station.
  void restore(RobotEntry& entry, const CommandRecord& record);

  // The stops that this answer to one of them settles, each with its reason. Empty when the robot has not obeyed.
  std::vector<std::pair<CommandId, const char*>> on_answer(RobotEntry& entry, const PendingCommand& answered,
                                                           const protocol::CommandAck& ack);
  // Once those are acknowledged: which stop the robot's state shows as pending.
  static void show_pending(RobotEntry& entry);

  // SAFETY: only a retired robot that is not connected, and cannot move any more: without its link it may go on for a
  // while. What it did before this station started is not known, so one that may come back from there is stopped, too.
  bool may_be_left_out(const RobotEntry& entry) const;

 private:
  std::shared_ptr<PendingCommand> make(RobotEntry& entry, const CommandRequest& request);
  void hand(RobotEntry& entry, PendingCommand& stop, std::vector<CommandRecord>& to_publish);

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  RecentCommands& recent_;
  const std::int64_t started_us_ = clock_.steady_us();
};

}  // namespace server::station
