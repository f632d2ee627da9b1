// Looks the names up.
#include "server/analysis/comparison/trace_channel.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace server::analysis {
namespace {

constexpr std::size_t kMostQuoted = 40;

std::vector<std::string> names_of_channels() {
  std::vector<std::string> names;
  for (const TraceChannel& channel : kTraceChannels) names.emplace_back(channel.name);
  return names;
}

}  // namespace

Result<TraceChannels> parse_trace_channels(const std::string& text) {
  TraceChannels channels;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    const auto found = std::ranges::find_if(kTraceChannels, [&](const auto& channel) { return name == channel.name; });
    if (found == kTraceChannels.end()) {
      return fail(ErrorCode::invalid,
                  fmt::format("channels has '{}', there are {}", name.substr(0, kMostQuoted),
                              fmt::join(names_of_channels(), ", ")),
                  "unknown_channel");
    }
    if (std::ranges::find(channels, &*found) != channels.end()) {
      return fail(ErrorCode::invalid, fmt::format("channels has {} twice", name), "unknown_channel");
    }
    channels.push_back(&*found);
    begin = end + 1;
  }
  return channels;
}

}  // namespace server::analysis
