#include "server/station/commands/robot_commands.hpp"

#include <algorithm>
#include <utility>

#include "server/station/commands/read_back.hpp"

namespace server::station {

void RobotCommands::add(const std::shared_ptr<PendingCommand>& pending) {
  pending->number = ++last_number;
  unanswered.emplace(pending->record.id, pending);
}

std::shared_ptr<PendingCommand> RobotCommands::find_unanswered(CommandId id) const {
  const auto found = unanswered.find(id);
  return found == unanswered.end() ? nullptr : found->second;
}

std::shared_ptr<PendingCommand> RobotCommands::take_unanswered(CommandId id) {
  auto pending = find_unanswered(id);
  unanswered.erase(id);
  return pending;
}

std::vector<CommandId> RobotCommands::queued() const {
  std::vector<CommandId> ids;
  for (const auto& [id, pending] : unanswered) {
    if (!pending->is_stop() && pending->record.state == CommandState::queued) ids.push_back(id);
  }
  return ids;
}

std::shared_ptr<PendingCommand> RobotCommands::newest_stop() const {
  std::shared_ptr<PendingCommand> newest;
  for (const auto& [id, pending] : unanswered) {
    if (pending->is_stop() && (newest == nullptr || pending->number > newest->number)) newest = pending;
  }
  return newest;
}

std::size_t RobotCommands::stops() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(unanswered, [](const auto& entry) { return entry.second->is_stop(); }));
}

std::shared_ptr<PendingCommand> RobotCommands::on_its_way(CommandId id) const {
  if (auto sent = find_unanswered(id)) return sent;
  for (const auto* acknowledged : {&unseen, &unread}) {
    const auto found = std::ranges::find(*acknowledged, id, [](const auto& pending) { return pending->record.id; });
    if (found != acknowledged->end()) return *found;
  }
  return nullptr;
}

void RobotCommands::keep_unknown(std::shared_ptr<PendingCommand> ended) {
  if (unknown.size() >= kMaxWaiting) unknown.pop_front();
  unknown.push_back(std::move(ended));
}

std::shared_ptr<PendingCommand> RobotCommands::reopen(CommandId id) {
  const auto found = std::ranges::find(unknown, id, [](const auto& pending) { return pending->record.id; });
  if (found == unknown.end()) return nullptr;
  auto pending = std::move(*found);
  unknown.erase(found);
  pending->record.state = CommandState::sent;
  pending->record.ended_at_us = 0;
  unanswered.emplace(id, pending);
  return pending;
}

std::vector<std::shared_ptr<PendingCommand>> RobotCommands::to_be_read_back() const {
  std::vector<std::shared_ptr<PendingCommand>> sent{unread.begin(), unread.end()};
  for (const auto& [id, pending] : unanswered) {
    if (pending->record.state == CommandState::sent && is_read_back(pending->wire)) sent.push_back(pending);
  }
  std::ranges::sort(sent, {}, &PendingCommand::number);
  return sent;
}

}  // namespace server::station
