// The profile of an experiment with three tones, for a controller without a model (control/tuning/three_tones).
#pragma once

#include <nlohmann/json.hpp>

namespace server::experiments {

// As a document that profile_document reads. After 5 s come whole windows of the measurement, up to four and within two
// minutes where a window is as short; `amplitude_m` is that of each tone of the setpoint.
nlohmann::json three_tones_document(double crossover_rad_s, double amplitude_m);

}  // namespace server::experiments
