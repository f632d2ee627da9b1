// A sample as a message in JSON with its JSON Schema: the same in MCAP files and live for Foxglove.
//
//   span, boot_id, seq, robot_time_us, t_s, utc_us, the rows of kSampleFields, those of kBatchFields,
//   clock_uncertainty_us, first_received_at_us, received_at_us, gap_before, gap_after, missed_ticks_before,
//   unknown_values
//
// A value that is none, or not finite, is left out; a number of a sample is the shortest decimal that gives the same
// binary32 back. What a sample has only as part of a run (span, t_s, gap_before, gap_after, missed_ticks_before) is
// missing in live messages. The schema says of the position that it is believed, and which member is its ±. No errors.
#pragma once

#include <bitset>
#include <cstdint>
#include <optional>
#include <string>

#include "server/station/state/telemetry_fields.hpp"

namespace server::station {

inline constexpr const char* kTelemetrySchemaName = "rheonaut.Telemetry";

using ChosenFields = std::bitset<kSampleFieldCount>;  // of each sample, by the row of kSampleFields

std::string telemetry_schema(const ChosenFields& chosen);

struct ReceptionTimes {
  std::int64_t clock_uncertainty_us = -1;                     // of utc_us; -1: no estimate yet
  std::int64_t first_received_at_us = 0, received_at_us = 0;  // UTC, of the batch's first and last sample
};

struct SamplePlace {
  std::uint64_t seq = 0, robot_time_us = 0;
  std::int64_t utc_us = 0;
};

struct SampleInRun {
  std::int64_t since_us = 0;                    // since the first sample of its span, written as t_s
  std::uint64_t gap_before = 0, gap_after = 0;  // samples that are missing there
  std::uint64_t missed_ticks_before = 0;        // at which the robot made no sample
};

// The messages of samples that share everything but their values; what they share is written once.
class TelemetryMessages {
 public:
  TelemetryMessages(std::optional<std::uint32_t> span, std::uint64_t boot_id, const SampleContext& context,
                    const ReceptionTimes& times, const ChosenFields& chosen);

  void append(std::string& out, const SamplePlace& place, const Sample& sample,
              std::optional<SampleInRun> in_run) const;

 private:
  ChosenFields chosen_;
  std::string beginning_, shared_, end_;
};

}  // namespace server::station
