// Estimates a robot's clock from exchanges of four time stamps, as NTP does, and how wrong the estimate can be.
//
//   station sends at t1 (station steady), robot receives at t2 (robot), answers at t3 (robot), station receives at t4
//   offset at t2 ≥ t1 - t2,  offset at t3 ≤ t4 - t3     station steady time = robot time + offset             (1)
//   offset = the middle of the two,  error ≤ half of t4 - t1 - (t3 - t2), whatever the asymmetry              (2)
//
// By (1), two exchanges a and b bound the drift between them, the growth of the offset with the robot's time:
//
//   (t1 - t2)_b - (t4 - t3)_a          (t4 - t3)_b - (t1 - t2)_a
//   ─────────────────────────  ≤ drift ≤  ─────────────────────────                                           (3)
//        t2_b - t3_a                            t3_b - t2_a
//
// The range of the drift is what all pairs (3) leave of the range that the protocol promises. The bound of an exchange
// grows with its age by the range's far end, and by kLeastGrowthPpm at least; the exchange with the smallest bound
// counts. Pairs that contradict each other mean that the clock has jumped or changed its pace: then only the newest
// exchange counts. One for each boot of a robot: it outlives a connection, for the robot's clock runs on.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>

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
  static constexpr std::size_t kWindow = 60;         // exchanges kept, one a second
  static constexpr std::size_t kLeastForDrift = 10;  // exchanges, before drift_ppm is reported
  static constexpr double kLeastGrowthPpm = 100;     // of a cheap crystal
  static constexpr double kWanderPpm = 20;           // how far its drift moves with the temperature
  static constexpr double kPromisedDriftPpm = 1000;  // docs/protocol.md

  // Takes one exchange. An impossible one (negative times or round trip) changes nothing.
  void add(const ClockExchange& exchange);

  const ClockEstimate& estimate() const { return estimate_; }

 private:
  struct DriftRange {
    double least_ppm = -std::numeric_limits<double>::infinity();
    double most_ppm = std::numeric_limits<double>::infinity();

    bool is_empty() const { return least_ppm > most_ppm; }
    DriftRange within(const DriftRange& other) const;
  };
  struct Measurement {
    std::int64_t received_at_robot_us = 0;  // t2
    std::int64_t answered_at_robot_us = 0;  // t3
    std::int64_t least_offset_us = 0;       // at t2
    std::int64_t most_offset_us = 0;        // at t3
    DriftRange drift;                       // by the pairs with the exchanges before it
  };

  static DriftRange drift_between(const Measurement& before, const Measurement& after);
  void measure_drift();
  void choose_offset();

  std::deque<Measurement> measurements_;
  ClockEstimate estimate_;
};

}  // namespace server::station
