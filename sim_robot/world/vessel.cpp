// Lays the vessel out and finds the flow's velocity at a place.
#include "sim_robot/world/vessel.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

double per_area(double diameter_m) { return 4 / (std::numbers::pi * diameter_m * diameter_m); }

void check_length(const char* name, double value_m, double least_m, double most_m) {
  if (!(value_m >= least_m && value_m <= most_m)) {
    base::throw_invalid("vessel: ", name, " must be in [", least_m, ", ", most_m, "], is ", value_m);
  }
}

}  // namespace

double tube_area_m2(double diameter_m) { return 1 / per_area(diameter_m); }

void check(const VesselParameters& p) {
  check_length("large_diameter_m", p.large_diameter_m, 0.03, 10);
  check_length("small_diameter_m", p.small_diameter_m, 0.03, p.large_diameter_m);
  check_length("reservoir_diameter_m", p.reservoir_diameter_m, 0.03, 10);
  check_length("body_length_m", p.body_length_m, 0.001, 1);
  check_length("large_length_m", p.large_length_m, p.body_length_m, 1e5);
  check_length("small_length_m", p.small_length_m, p.body_length_m, 1e5);
  check_length("reservoir_length_m", p.reservoir_length_m, p.body_length_m, 1e5);
  const double behind_m = p.is_large_tube_first ? p.large_length_m : p.small_length_m;
  const double ahead_m = p.is_large_tube_first ? p.small_length_m : p.large_length_m;
  const double room_m = p.reservoir_length_m - p.body_length_m / 2;  // the robot boots within the vessel
  check_length("junction_m", p.junction_m, -ahead_m - room_m, behind_m + room_m);
  check(p.pump);
}

Vessel::Vessel(const VesselParameters& p) : pump_(p.pump), stretches_{}, body_length_m_(p.body_length_m) {
  check(p);
  const Stretch large{0, p.large_length_m, per_area(p.large_diameter_m)};
  const Stretch small{0, p.small_length_m, per_area(p.small_diameter_m)};
  const Stretch reservoir{0, p.reservoir_length_m, per_area(p.reservoir_diameter_m)};
  stretches_ = {reservoir, p.is_large_tube_first ? large : small, p.is_large_tube_first ? small : large, reservoir};
  double start_m = p.junction_m - stretches_[1].length_m - stretches_[0].length_m;
  first_m_ = start_m + body_length_m_ / 2;
  for (Stretch& stretch : stretches_) {
    stretch.start_m = start_m;
    start_m += stretch.length_m;
  }
  last_m_ = start_m - body_length_m_ / 2;
}

// ∫ dx/A from the start of the vessel.
double Vessel::passed_per_area(double position_m) const {
  double sum = 0;
  for (const Stretch& stretch : stretches_) {
    sum += stretch.per_area_m2 * std::clamp(position_m - stretch.start_m, 0.0, stretch.length_m);
  }
  return sum;
}

double Vessel::tube_area_m2(double position_m) const {
  return 1 / (position_m < stretches_[2].start_m ? stretches_[1] : stretches_[2]).per_area_m2;
}

double Vessel::velocity_m_s(double position_m) const {
  for (const Stretch& stretch : stretches_) {
    const double from_m = position_m - body_length_m_ / 2 - stretch.start_m;
    if (from_m >= 0 && from_m + body_length_m_ <= stretch.length_m) return pump_.flow_m3_s() * stretch.per_area_m2;
  }
  const double half_m = body_length_m_ / 2;
  return pump_.flow_m3_s() * (passed_per_area(position_m + half_m) - passed_per_area(position_m - half_m)) /
         body_length_m_;  // (1)
}

}  // namespace sim_robot
