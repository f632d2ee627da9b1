// Drops commands that may no longer run: those that wait for the link, and those that wait on the robot for their
// time.
//
// SAFETY: no timed command outlives its sender's control, nor the limits that it was checked against. Its sender is one
// client: what waits on the robot goes when another page or program of the same actor comes into control.
// Loop thread.
#pragma once

#include <boost/asio/io_context.hpp>
#include <functional>

#include "server/station/command_tracker.hpp"

namespace server::station {

class TimedCommands {
 public:
  TimedCommands(boost::asio::io_context& loop, runtime::Clock& clock, SinkNotifier& notifier, CommandTracker& tracker)
      : loop_{loop}, clock_{clock}, notifier_{notifier}, tracker_{tracker} {}

  // Drops what is to be dropped now, given who is in control (no actor: nobody). Sent before anything that comes next,
  // on a link that keeps the order. False: there is no room for it on the link, so no command may follow.
  bool drop_outdated(RobotEntry& entry, const Client& holder);

  // The same for everything that waits, for a reason of the station's own.
  void drop_all(RobotEntry& entry, const Client& holder, const char* reason);

  // The robot comes to rest, in nobody's name. False: there is no room for that on the link now.
  bool bring_to_rest(RobotEntry& entry);

  // SAFETY: what still waits for the link is not sent once it may no longer be, timed or not; but it may end a motion.
  void withdraw_queued(RobotEntry& entry, const char* reason,
                       const std::function<bool(const PendingCommand&)>& is_meant);

 private:
  void choose_reason(RobotEntry& entry, const Client& holder) const;
  bool send_drop(RobotEntry& entry);
  CommandId send_own(RobotEntry& entry, CommandRequest request);  // 0: there is no room for it
  void end_timed(RobotEntry& entry, const char* reason);

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  SinkNotifier& notifier_;
  CommandTracker& tracker_;
};

}  // namespace server::station
