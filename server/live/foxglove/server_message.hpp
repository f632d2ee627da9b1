// The messages of the station to a Foxglove client, as text and bytes.
//
//   message data := 1(u8) subscription(u32) log time in ns(u64) JSON     little-endian, binary; all others are text
//
// docs/foxglove.md; https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md. No errors.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "server/live/foxglove/client_message.hpp"
#include "server/live/foxglove/topics.hpp"

namespace server::live::foxglove {

enum class StatusLevel : std::uint8_t { note = 0, warning = 1, error = 2 };

struct Channel {
  ChannelId id = 0;
  std::string topic;  // with the robot before it, where there are several: "/sim-1/telemetry"
  Topic kind = Topic::telemetry;
};

// `session`: the same until the station starts again. It offers no capability: nothing can be changed through it.
std::string server_facts_message(const std::string& name, const std::string& session);
std::string advertise_message(std::span<const Channel> channels);
std::string unadvertise_message(std::span<const ChannelId> channels);
// A status with an id takes the place of the one before it; empty: it has none.
std::string status_message(StatusLevel level, const std::string& message, const std::string& id = "");

using DataHead = std::array<char, 1 + 4 + 8>;
DataHead data_head(SubscriptionId subscription, std::uint64_t log_time_ns);

}  // namespace server::live::foxglove
