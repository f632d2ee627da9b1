// Names are those of the table of telemetry fields.
#include "server/storage/samples/channels.hpp"

#include <fmt/format.h>

#include <limits>

namespace server::storage {
namespace {

enum Shared : std::uint8_t { setpoint, disturbance, position_sd, estimated_position };
constexpr std::array<const char*, kSharedChannels> kSharedNames{"setpoint_m", "disturbance_m", "position_sd_m",
                                                                "estimated_position_m"};
constexpr std::size_t kPosition = 0;  // of kSampleFields
static_assert(station::kSampleFields[kPosition].member == &station::Sample::position_m);

// Both sides of the subtraction are binary32; the result is rounded to it once, in SQL as here.
float estimated_m(float position_m, float disturbance_m) {
  return static_cast<float>(static_cast<double>(position_m) - static_cast<double>(disturbance_m));
}

template <std::size_t count, class NameOf>
Result<std::bitset<count>> parse_names(std::string_view text, NameOf name_of) {
  std::bitset<count> channels;
  for (bool more = true; more;) {
    const std::size_t comma = text.find(',');
    const std::string_view name = text.substr(0, comma);
    std::size_t index = 0;
    while (index < count && name != name_of(index)) ++index;
    if (index == count || channels[index]) {
      const char* problem = index == count ? "is no channel" : "is given twice";
      return fail(ErrorCode::bad_request, fmt::format("channels: '{}' {}", name.substr(0, 40), problem),
                  "out_of_range");
    }
    channels.set(index);
    more = comma != std::string_view::npos;
    if (more) text.remove_prefix(comma + 1);
  }
  return channels;
}

}  // namespace

const char* text(Channel value) { return station::kSampleFields[static_cast<std::size_t>(value)].name; }

Result<Channels> parse_channels(std::string_view text) {
  return parse_names<kChannels>(text, [](std::size_t index) { return station::kSampleFields[index].name; });
}

const char* overview_name(std::size_t index) {
  return index < kSharedChannels ? kSharedNames[index] : station::kSampleFields[index - kSharedChannels].name;
}

OverviewChannels overview_channels(Channels of_samples) {
  OverviewChannels channels;
  for (std::size_t channel = 0; channel < kChannels; ++channel) channels[overview_index(channel)] = of_samples[channel];
  return channels;
}

Result<OverviewChannels> parse_overview_channels(std::string_view text) {
  return parse_names<kOverviewChannels>(text, overview_name);
}

Channels sample_channels(OverviewChannels channels) {
  Channels of_samples;
  for (std::size_t channel = 0; channel < kChannels; ++channel) of_samples[channel] = channels[overview_index(channel)];
  if (channels[estimated_position]) of_samples.set(kPosition);
  return of_samples;
}

float overview_value(std::size_t index, const station::Sample& sample, const station::SampleContext& context) {
  switch (index) {
    case setpoint: return station::or_nan(context.setpoint_m);
    case disturbance: return station::or_nan(context.disturbance_m);
    case position_sd: return station::or_nan(context.position_sd_m);
    case estimated_position: return estimated_m(sample.position_m, station::or_nan(context.disturbance_m));
    default: return sample.*kSampleMembers[index - kSharedChannels];
  }
}

ExtremeColumns extreme_columns(std::size_t index, std::int64_t version) {
  if (index == estimated_position) return {"min_position_m - disturbance_m", "max_position_m - disturbance_m"};
  if (index < kSharedChannels) return {kSharedNames[index], kSharedNames[index]};
  const station::SampleField& field = station::kSampleFields[index - kSharedChannels];
  if (field.since_schema > version) return {"NULL", "NULL"};
  return {fmt::format("min_{}", field.name), fmt::format("max_{}", field.name)};
}

}  // namespace server::storage
