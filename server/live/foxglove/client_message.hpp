// A message of a Foxglove client, parsed.
//
//   {"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]}    {"op":"unsubscribe","subscriptionIds":[0]}
//
// Everything else that the protocol has for clients (advertise and message data, parameters, services, assets, the
// connection graph) needs a capability that the station does not offer, and is refused with a sentence for people.
// docs/foxglove.md; https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md. Bounded in depth; never throws.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <variant>
#include <vector>

namespace server::live::foxglove {

inline constexpr std::size_t kMaxClientMessageBytes = 4096;  // 48 channels need 2 kB; it is parsed on the loop

using ChannelId = std::uint32_t;
using SubscriptionId = std::uint32_t;

struct Subscribe {
  struct Entry {
    SubscriptionId id;
    ChannelId channel;
  };
  std::vector<Entry> subscriptions;
};
struct Unsubscribe {
  std::vector<SubscriptionId> subscriptions;
};
using ClientMessage = std::variant<Subscribe, Unsubscribe>;

// Reads a text message. The error is a sentence that says what is wrong and which value.
std::expected<ClientMessage, std::string> parse_client_message(const std::string& text);

// Why a binary message is not acted on: all of them would change something.
std::string refusal_of_binary(const std::string& bytes);

}  // namespace server::live::foxglove
