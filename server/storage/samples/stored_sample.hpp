// A sample as it was recorded, with what it shares with others of its batch.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/station/state/station_state.hpp"
#include "server/storage/samples/segment.hpp"

namespace server::storage {

// Of the context, period_us is known only where the sample was read with its segment.
struct StoredSample : station::SampleContext {
  std::uint32_t span = 0;  // index of the run's span
  station::BootId boot_id = 0;
  std::uint64_t seq = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_us = 0;                 // robot time + the clock estimate stored with it
  std::int64_t clock_uncertainty_us = -1;  // half-width of that estimate; -1: there was none
  std::int64_t first_received_at_us = 0;  // it arrived between these two: the arrivals of the first and the last sample
  std::int64_t received_at_us = 0;        // of its segment, which spans at most 1 s
  station::Sample sample;
};

// The sample number `index` of a segment.
StoredSample stored_sample(const Segment& segment, std::size_t index, std::uint32_t span, station::BootId boot_id);

}  // namespace server::storage
