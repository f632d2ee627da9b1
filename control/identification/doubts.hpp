// The doubts of an identification about its own result, as codes with numbers, and the factor by which each widens what
// is computed from the model.
//
//   w = √(1 + share · n/k)        what the linear model lacks, against what its k parameters cost             (1)
//   w = √(n/n_effective)          residuals of which neighbours are alike: (7) of fit_statistics.hpp          (2)
//   w = √R                        residuals that drift: (8) of fit_statistics.hpp                             (3)
//   w = √(1 + (z² - 1)/k)         a sensor z sds off its data sheet: squares that its prior costs, as in (1)   (4)
//   widening = √(1 + Σ (w² - 1))                                                                              (5)
//
// w is what the sd of the model's output over the run is multiplied by when the doubt is counted. White residuals of sd
// s give that output an rms sd of s √(k/n); a share of their squares that the model could have explained is an error of
// s √share beside it: (1). A doubt is grave if w > 2: by its size, never by a p-value alone. A fit whose sd nobody
// knows (its search did not converge) has no w, and is grave; so is a dead zone, which widens nothing that is computed
// from the model, and makes it another motor's on a robot whose dead_zone_duty is not set. Errors: none thrown.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/search/fit.hpp"

namespace control {

inline constexpr double kGraveWidening = 2;

enum class DoubtCode {
  search_not_converged,            // value: iterations of the best start
  no_linear_model_over_amplitude,  // value: the share of (1)
  correlated_with_input,           // value: the share of (1)
  runs_disagree,                   // value: the share of (1)
  residuals_not_white,             // value: w
  residuals_drift,                 // value: w
  parameter_not_determined,        // value: one sigma, of kp, b1 and b2 relative to the parameter
  parameter_at_bound,              // value: the parameter
  part_of_run_used,                // value: the share of the run's time that the fit used
  dead_time_not_determined,        // value: its sd in s, beside what the fit says; none: at the limit of the search
  dead_zone,                       // value: the duty below which the motor stands still, which no model holds
  sensor_unlike_data_sheet,        // value: how many sds of (1) or (3) of sensor_prior.hpp; parameter: of SensorFit
};

struct Doubt {
  DoubtCode code = DoubtCode::search_not_converged;
  std::optional<double> value;         // as the code says; none: without bound
  std::string parameter = {};          // its name, of a doubt about one
  std::optional<double> widening = 1;  // w; none: not known
};

bool is_grave(const Doubt& doubt);
std::string in_words(const Doubt& doubt);  // with the value; no full stop

std::optional<double> widening(std::span<const Doubt> doubts);  // (5); none: not known

// amplitude, input: of score_doubts.hpp; share_used: of the run's ticks.
std::vector<Doubt> doubts_about(const Fit& fit, const std::optional<ScoreEvidence>& amplitude,
                                const std::optional<ScoreEvidence>& input, double share_used);

// Doubts about a sensor that is far from its data sheet; doubts_about() of one recording has them.
std::vector<Doubt> sensor_doubts(const Fit& fit);

double dead_time_sd_s(std::span<const Doubt> doubts);  // 0: none is in doubt

// A dead time and the age of an acceleration's readings look the same. In doubt is the sensor's own lag, if it
// was not given, by (2) of sensor_prior.hpp or by the whole delay where that is shorter, and of samples in step with
// the ticks when within a tick they were taken, dt/√12. A delay beyond 3 sds of (2) is no lag of such a sensor, and in
// doubt as a whole if it was not taken for a dead time. It widens no response, and is the sd of a dead time: w = 1.
std::optional<Doubt> dead_time_doubt(const Fit& fit, const IdentificationOptions& options, double dt_s);

}  // namespace control
