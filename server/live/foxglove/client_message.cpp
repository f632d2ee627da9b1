// Strict in what it acts on; members that it does not know are passed over, as the protocol may grow.
#include "server/live/foxglove/client_message.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

namespace server::live::foxglove {

using nlohmann::json;
using Refusal = std::unexpected<std::string>;

namespace {

constexpr int kMaxDepth = 8;  // a subscription is nested 3 deep
constexpr std::size_t kMaxQuoted = 40;

constexpr std::array<std::string_view, 9> kNotOffered{"advertise",
                                                      "unadvertise",
                                                      "getParameters",
                                                      "setParameters",
                                                      "subscribeParameterUpdates",
                                                      "unsubscribeParameterUpdates",
                                                      "fetchAsset",
                                                      "subscribeConnectionGraph",
                                                      "unsubscribeConnectionGraph"};

// Not parsed further where it is nested deeper: what is parsed is destroyed by recursion.
json parse_shallow(const std::string& text) {
  bool is_too_deep = false;
  const auto keep = [&is_too_deep](int depth, json::parse_event_t, json&) {
    is_too_deep = is_too_deep || depth > kMaxDepth;
    return !is_too_deep;
  };
  json value = json::parse(text, keep, false);
  return is_too_deep ? json(json::value_t::discarded) : value;
}

bool is_number(const json& value) {
  return value.is_number_unsigned() && value.get<std::uint64_t>() <= std::numeric_limits<std::uint32_t>::max();
}

std::uint32_t number(const json& value) { return static_cast<std::uint32_t>(value.get<std::uint64_t>()); }

std::expected<ClientMessage, std::string> parse_subscribe(const json& message) {
  const auto list = message.find("subscriptions");
  if (list == message.end() || !list->is_array()) return Refusal{"subscribe: subscriptions is not a list"};
  Subscribe subscribe;
  for (const json& entry : *list) {
    const bool is_whole = entry.is_object() && entry.contains("id") && entry.contains("channelId") &&
                          is_number(entry["id"]) && is_number(entry["channelId"]);
    if (!is_whole) return Refusal{"subscribe: an entry has no id and channelId from 0 to 4294967295"};
    subscribe.subscriptions.push_back({number(entry["id"]), number(entry["channelId"])});
  }
  return subscribe;
}

std::expected<ClientMessage, std::string> parse_unsubscribe(const json& message) {
  const auto list = message.find("subscriptionIds");
  if (list == message.end() || !list->is_array()) return Refusal{"unsubscribe: subscriptionIds is not a list"};
  Unsubscribe unsubscribe;
  for (const json& id : *list) {
    if (!is_number(id)) return Refusal{"unsubscribe: a subscription id is not a number from 0 to 4294967295"};
    unsubscribe.subscriptions.push_back(number(id));
  }
  return unsubscribe;
}

}  // namespace

std::expected<ClientMessage, std::string> parse_client_message(const std::string& text) {
  const json message = parse_shallow(text);
  if (!message.is_object()) return Refusal{"the message is not a JSON object, or is nested too deep"};
  const auto op = message.find("op");
  if (op == message.end() || !op->is_string()) return Refusal{"the message has no op"};
  const auto& name = op->get_ref<const std::string&>();
  if (name == "subscribe") return parse_subscribe(message);
  if (name == "unsubscribe") return parse_unsubscribe(message);
  if (std::ranges::find(kNotOffered, name) != kNotOffered.end()) {
    return Refusal{fmt::format("{} is not possible: this connection only reads", name)};
  }
  return Refusal{fmt::format("the op '{}' is not known", name.substr(0, kMaxQuoted))};
}

std::string refusal_of_binary(const std::string& bytes) {
  const int opcode = bytes.empty() ? 0 : static_cast<unsigned char>(bytes.front());
  if (opcode == 1) return "publishing is not possible: this connection only reads";
  if (opcode == 2) return "a service call is not possible: this connection only reads";
  return fmt::format("the binary opcode {} is not known", opcode);
}

}  // namespace server::live::foxglove
