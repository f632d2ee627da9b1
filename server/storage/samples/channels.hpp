// The channels of samples, by name and by index; and those of overviews, which also have what a batch of samples
// shares.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "server/runtime/result.hpp"
#include "server/station/state/telemetry_fields.hpp"

namespace server::storage {

// A row of kSampleFields, by its index.
enum class Channel : std::uint8_t {};
constexpr std::size_t kChannels = station::kSampleFieldCount;
using Channels = std::bitset<kChannels>;
inline Channels all_channels() { return Channels{}.set(); }

// By Channel.
inline constexpr auto kSampleMembers = [] {
  std::array<float station::Sample::*, kChannels> members{};
  for (std::size_t index = 0; index < kChannels; ++index) members[index] = station::kSampleFields[index].member;
  return members;
}();

const char* text(Channel value);

// "position_m,duty": names with commas between them, each once; bad_request says which one is not.
Result<Channels> parse_channels(std::string_view text);

// Channels of an overview by index: setpoint_m, disturbance_m and position_sd_m, which a batch of samples shares;
// estimated_position_m = position_m - disturbance_m, where the robot believes to be; then those of samples, by Channel.
// Stored by index (groups/segment_groups.hpp), so a new channel is added at the end.
constexpr std::size_t kSharedChannels = 4;
constexpr std::size_t kOverviewChannels = kSharedChannels + kChannels;
using OverviewChannels = std::bitset<kOverviewChannels>;

constexpr std::size_t overview_index(std::size_t channel) { return kSharedChannels + channel; }
const char* overview_name(std::size_t index);
OverviewChannels overview_channels(Channels of_samples);
Result<OverviewChannels> parse_overview_channels(std::string_view text);

// What must be read of samples for these.
Channels sample_channels(OverviewChannels channels);
// NaN: it is no finite number.
float overview_value(std::size_t index, const station::Sample& sample, const station::SampleContext& context);
// The least and the largest value in a segment, as SQL; "NULL" where a database of this version does not have it.
struct ExtremeColumns {
  std::string min, max;
};
ExtremeColumns extreme_columns(std::size_t index, std::int64_t version);

}  // namespace server::storage
