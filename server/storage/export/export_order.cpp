// Text by position.
#include "server/storage/export/export_order.hpp"

#include <fmt/format.h>

#include <charconv>

namespace server::storage {
namespace {

constexpr std::size_t kArgumentCount = 7;

std::string channel_names(const Channels& channels) {
  std::string names;
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    if (!channels[channel]) continue;
    names += fmt::format("{}{}", names.empty() ? "" : ",", text(static_cast<Channel>(channel)));
  }
  return names.empty() ? "-" : names;
}

Result<std::int64_t> number_of(const char* what, const std::string& word) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error == std::errc{} && end == word.data() + word.size() && number >= 0) return number;
  return fail(ErrorCode::invalid, fmt::format("{} is '{}', not a whole number from 0", what, word));
}

}  // namespace

std::vector<std::string> export_arguments(const ExportOrder& order, pid_t parent) {
  return {order.database.string(), std::to_string(order.query.run),     text(order.format),
          order.file.string(),     channel_names(order.query.channels), std::to_string(order.query.grid_us.value_or(0)),
          std::to_string(parent)};
}

Result<ReceivedOrder> parse_export_arguments(const std::vector<std::string>& arguments) {
  if (arguments.size() != kArgumentCount) {
    return fail(ErrorCode::invalid,
                "this program is started by the station and by `rheonaut export`, which is the command to use");
  }
  ReceivedOrder received;
  ExportOrder& order = received.order;
  order.database = arguments[0];
  order.file = arguments[3];
  const auto run = number_of("RUN", arguments[1]), grid_us = number_of("GRID_US", arguments[5]),
             parent = number_of("PARENT", arguments[6]);
  for (const auto& number : {run, grid_us, parent}) {
    if (!number) return std::unexpected{number.error()};
  }
  order.query.run = *run;
  if (*grid_us != 0) order.query.grid_us = *grid_us;
  received.parent = static_cast<pid_t>(*parent);
  const auto format = parse_export_format(arguments[2]);
  if (!format) return fail(ErrorCode::invalid, fmt::format("there is no format '{}'", arguments[2]));
  order.format = *format;
  order.query.channels = {};
  if (arguments[4] != "-") {
    const auto channels = parse_channels(arguments[4]);
    if (!channels) return std::unexpected{channels.error()};
    order.query.channels = *channels;
  }
  return received;
}

}  // namespace server::storage
