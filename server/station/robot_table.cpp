#include "server/station/robot_table.hpp"

#include <fmt/format.h>

#include <utility>

namespace server::station {

RobotEntry& RobotTable::add(const RobotId& id) {
  RobotState& robot = states_[id];
  robot.id = id;
  return entries_.try_emplace(id, robot).first->second;
}

RobotEntry* RobotTable::find(const RobotId& id) {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second;
}

const RobotEntry* RobotTable::find(const RobotId& id) const {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second;
}

RobotEntry* RobotTable::find(const RobotId& id, BootId boot_id) {
  RobotEntry* entry = find(id);
  return entry == nullptr || entry->robot.boot_id != boot_id ? nullptr : entry;
}

RobotLink* RobotTable::connect(RobotEntry& entry, RobotLink& link) {
  RobotLink* previous = std::exchange(entry.link, &link);
  if (previous != nullptr) previous->entry_ = nullptr;
  link.entry_ = &entry;
  return previous;
}

void RobotTable::disconnect(RobotEntry& entry) {
  if (RobotLink* link = std::exchange(entry.link, nullptr); link != nullptr) link->entry_ = nullptr;
}

Result<void> RobotTable::may_connect(const RobotId& id, BootId boot_id, std::int64_t now_us,
                                     std::int64_t timeout_us) const {
  const RobotEntry* entry = find(id);
  if (entry == nullptr || entry->link == nullptr || entry->robot.boot_id == boot_id) return {};
  const RobotState& robot = entry->robot;
  const std::int64_t silent_us = now_us - robot.last_received_steady_us;
  if (silent_us >= timeout_us) return {};
  return fail(ErrorCode::conflict,
              fmt::format("robot '{}' is connected from {} with boot {}; its last frame came {} ms ago", id, robot.peer,
                          robot.boot_id, silent_us / 1000));
}

}  // namespace server::station
