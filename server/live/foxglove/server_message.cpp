// Text by the JSON library, the head of message data byte by byte.
#include "server/live/foxglove/server_message.hpp"

#include <concepts>
#include <nlohmann/json.hpp>

#include "base/json_text.hpp"

namespace server::live::foxglove {

using nlohmann::json;

std::string server_facts_message(const std::string& name, const std::string& session) {
  return base::dump({{"op", "serverInfo"}, {"name", name}, {"capabilities", json::array()}, {"sessionId", session}});
}

std::string advertise_message(std::span<const Channel> channels) {
  json list = json::array();
  for (const Channel& channel : channels) {
    list.push_back({{"id", channel.id},
                    {"topic", channel.topic},
                    {"encoding", "json"},
                    {"schemaName", schema_name_of(channel.kind)},
                    {"schema", schema_of(channel.kind)},
                    {"schemaEncoding", "jsonschema"}});
  }
  return base::dump({{"op", "advertise"}, {"channels", std::move(list)}});
}

std::string unadvertise_message(std::span<const ChannelId> channels) {
  return base::dump({{"op", "unadvertise"}, {"channelIds", channels}});
}

std::string status_message(StatusLevel level, const std::string& message, const std::string& id) {
  json status{{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}};
  if (!id.empty()) status["id"] = id;
  return base::dump(status);
}

DataHead data_head(SubscriptionId subscription, std::uint64_t log_time_ns) {
  DataHead head{1};
  const auto set = [&head]<std::unsigned_integral Number>(std::size_t at, Number value) {
    for (std::size_t byte = 0; byte < sizeof value; ++byte) head[at + byte] = static_cast<char>(value >> (8 * byte));
  };
  set(1, subscription);
  set(5, log_time_ns);
  return head;
}

}  // namespace server::live::foxglove
