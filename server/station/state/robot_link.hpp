// The interface to one connected robot; a robot session implements it.
//
// Loop thread. The station drops the link in Station::on_disconnected, which the session calls before it ends.
#pragma once

#include <string>

#include "server/station/state/station_state.hpp"

namespace server::station {

struct RobotEntry;  // server/station/robot_entry.hpp

class RobotLink {
 public:
  virtual ~RobotLink() = default;

  virtual const RobotId& robot_id() const = 0;

  // Queues a command, to be written before `deadline_us` (steady) or not at all. False when the bounded queue is full:
  // the command was not taken. SAFETY: never false right after a withdraw() that took one back, so that a command that
  // is refused has not cost an older one.
  virtual bool send(const protocol::Command& command, std::int64_t deadline_us) = 0;

  // Takes a queued command back; false when it has left.
  virtual bool withdraw(CommandId id) = 0;

  // SAFETY: written ahead of everything that waits; drops the queued commands it supersedes. Never refused. When
  // the link takes it at once, its frame leaves within this call.
  virtual void send_emergency_stop(const protocol::Command& command) = 0;

  // Everything of this boot below these numbers is durable or known lost.
  virtual void acknowledge(std::uint64_t durable_next_seq, std::uint64_t durable_next_event_seq) = 0;

  // Asks for the samples [first_seq, next_seq) again.
  virtual void request_resend(std::uint64_t first_seq, std::uint64_t next_seq) = 0;

  // Asks for every event again that is not durable.
  virtual void request_event_resend() = 0;

  // Ends the connection; the reason is logged.
  virtual void close(const std::string& reason) = 0;

 private:
  friend class RobotTable;
  RobotEntry* entry_ = nullptr;  // of its robot, while this link is the one that the station uses
};

}  // namespace server::station
