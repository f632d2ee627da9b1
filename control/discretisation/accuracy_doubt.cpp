// Compares the errors below the bandwidth with what is acceptable.
#include "control/discretisation/accuracy_doubt.hpp"

#include <sstream>

namespace control {

std::string accuracy_doubt(const Discretisation& made) {
  const DiscretisationErrors& errors = made.errors;
  const bool is_close = errors.max_relative_in_bandwidth <= kAcceptableRelative;
  if (is_close && errors.max_deg_in_bandwidth <= kAcceptableDeg) return {};
  std::ostringstream text;
  text.precision(3);
  text << "below " << errors.bandwidth_rad_s << " rad/s these coefficients are up to "
       << 100 * errors.max_relative_in_bandwidth << " % and " << errors.max_deg_in_bandwidth
       << " degrees off the controller (acceptable: " << 100 * kAcceptableRelative << " % and " << kAcceptableDeg
       << "), so the loop does not have the margins of the design: shorten the period (--period-s), raise the order "
          "(--order), or give the bandwidth that the loop has (--bandwidth-rad-s)";
  return text.str();
}

}  // namespace control
