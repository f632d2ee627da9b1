// How long it takes follows from the crossover.
#include "server/experiments/three_tones_document.hpp"

#include <algorithm>
#include <cmath>

#include "control/tuning/three_tones.hpp"

namespace server::experiments {

nlohmann::json three_tones_document(double crossover_rad_s, double amplitude_m) {
  constexpr double kBeginning_s = 5, kLongest_s = 110, kMostWindows = 4, kSpare_s = 0.4;
  const double window_s = control::tone_window_s(crossover_rad_s);
  const double windows = std::clamp(std::floor(kLongest_s / window_s), 1.0, kMostWindows);
  const double reach_m = 3 * amplitude_m;
  return {{"name", "Three tones"},
          {"purpose", "For a controller without a model"},
          {"limits", {{"position_min_m", -reach_m}, {"position_max_m", reach_m}}},
          {"abort", {{"position_min_m", -2 * reach_m - 0.1}, {"position_max_m", 2 * reach_m + 0.1}}},
          {"step",
           {{{"kind", "tones"},
             {"setpoint_m", 0},
             {"amplitude_m", amplitude_m},
             {"crossover_rad_s", crossover_rad_s},
             {"for_s", kBeginning_s + windows * window_s + kSpare_s}}}}};
}

}  // namespace server::experiments
