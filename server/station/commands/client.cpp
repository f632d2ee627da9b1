#include "server/station/commands/client.hpp"

#include <fmt/format.h>

namespace server::station {
namespace {

constexpr std::size_t kShownOfId = 8;

bool is_of_page(const std::string& actor) {
  return actor.starts_with("session:") || actor.find("/session:") != std::string::npos;
}

}  // namespace

std::string text(const Client& client) {
  if (client.id.empty()) return client.actor;
  return fmt::format("{}, {} {}", client.actor, is_of_page(client.actor) ? "page" : "script",
                     client.id.substr(0, kShownOfId));
}

}  // namespace server::station
