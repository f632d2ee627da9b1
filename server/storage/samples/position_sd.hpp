// What the standard deviation of a position says of it: 0, it is known; above, it is an estimate; NaN, it is an
// estimate and how good it is, is not known.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace server::storage {

inline bool is_estimate(double position_sd_m) { return !(position_sd_m <= 0); }

// NaN where either is.
inline double larger_sd_m(double one_m, double other_m) {
  if (std::isnan(one_m) || std::isnan(other_m)) return std::numeric_limits<double>::quiet_NaN();
  return std::max(one_m, other_m);
}

}  // namespace server::storage
