// Estimates a robot's clock from exchanges of four time stamps, as NTP does.
//
//   station sends at t1 (station steady), robot receives at t2 (robot), answers at t3 (robot), station receives at t4
//   offset = ((t1 - t2) + (t4 - t3)) / 2     station steady time = robot time + offset
//   round trip = (t4 - t1) - (t3 - t2)       |offset error| ≤ round trip / 2, whatever the asymmetry
//
// The exchange with the smallest bound among the latest counts; its bound grows with its age by
// ClockEstimate::kMaxDriftPpm. One for each boot of a robot: it outlives a connection, for the robot's clock runs on.
#pragma once

#include <cstdint>
#include <deque>

#include "server/station/state/station_state.hpp"

namespace server::station {

struct ClockExchange {
  std::int64_t sent_at_us = 0;             // t1
  std::int64_t received_at_robot_us = 0;   // t2
  std::int64_t answered_at_robot_us = 0;   // t3
  std::int64_t answer_received_at_us = 0;  // t4
};

class ClockSync {
 public:
  static constexpr std::size_t kWindow = 60;  // exchanges kept, one a second

  // Takes one exchange. An impossible one (negative times or round trip) changes nothing.
  void add(const ClockExchange& exchange);

  const ClockEstimate& estimate() const { return estimate_; }

 private:
  struct Measurement {
    std::int64_t at_us = 0;  // of the station, steady
    std::uint64_t robot_time_us = 0;
    std::int64_t offset_us = 0;
    std::int64_t round_trip_us = 0;
  };

  double drift_ppm() const;

  std::deque<Measurement> measurements_;
  ClockEstimate estimate_;
};

}  // namespace server::station
