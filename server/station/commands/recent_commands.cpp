// A bounded map, oldest out first.
#include "server/station/commands/recent_commands.hpp"

#include <sodium.h>

#include <algorithm>
#include <cstring>

namespace server::station {

void RecentCommands::put(const CommandRecord& record, std::int64_t now_us) {
  if (const auto known = entries_.find(record.id); known != entries_.end()) {
    known->second.record = record;
    return;
  }
  if (order_.size() >= kMaxCommands) {
    entries_.erase(order_.front());
    order_.pop_front();
  }
  entries_.emplace(record.id, Entry{record, now_us});
  order_.push_back(record.id);
}

const RecentCommands::Entry* RecentCommands::find(CommandId id) const {
  const auto entry = entries_.find(id);
  return entry == entries_.end() ? nullptr : &entry->second;
}

CommandId command_id_of(const RobotId& robot_id, const std::string& actor, const std::string& key) {
  const std::string request = robot_id + '\n' + actor + '\n' + key;  // no part holds a line end
  unsigned char hash[crypto_generichash_BYTES_MIN];
  crypto_generichash(hash, sizeof hash, reinterpret_cast<const unsigned char*>(request.data()), request.size(), nullptr,
                     0);
  CommandId id = 0;
  std::memcpy(&id, hash, sizeof id);
  return std::max<CommandId>(id, 1);
}

bool is_command_key(const std::string& key) {
  constexpr std::size_t kMaxKey = 64;
  const auto is_allowed = [](char c) {
    const bool is_word = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    return is_word || c == '.' || c == '_' || c == ':' || c == '-';
  };
  return !key.empty() && key.size() <= kMaxKey && std::ranges::all_of(key, is_allowed);
}

}  // namespace server::station
