// The robots that the station knows: an entry for each, connected or not, and which connection is the robot's own.
//
// Entries are never removed, so references to them stay valid. Loop thread.
#pragma once

#include <map>
#include <string>

#include "server/runtime/result.hpp"
#include "server/station/robot_entry.hpp"

namespace server::station {

class RobotTable {
 public:
  RobotEntry& add(const RobotId& id);  // or the one that is there
  RobotEntry* find(const RobotId& id);
  const RobotEntry* find(const RobotId& id) const;
  RobotEntry* find(const RobotId& id, BootId boot_id);  // null also when it runs another boot
  const std::map<RobotId, RobotState>& states() const { return states_; }
  std::map<RobotId, RobotEntry>& entries() { return entries_; }

  // The entry whose connection this is; null when another has taken its place.
  static RobotEntry* of(const RobotLink& link) { return link.entry_; }
  // Makes it the robot's connection; returns the one that it replaces, null when there is none.
  static RobotLink* connect(RobotEntry& entry, RobotLink& link);
  static void disconnect(RobotEntry& entry);
  // Of two connections with the same boot the newer counts. One of another boot has to wait until the robot has been
  // silent for the timeout: conflict.
  Result<void> may_connect(const RobotId& id, BootId boot_id, std::int64_t now_us, std::int64_t timeout_us) const;

 private:
  std::map<RobotId, RobotState> states_;
  std::map<RobotId, RobotEntry> entries_;  // the same robots
};

}  // namespace server::station
