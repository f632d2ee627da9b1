// Which run of a profile with `until` promises most: the one after which the model would be known best.
//
//   I(runs) = Σ_runs JᵀJ/sd²,  sigma² = diagonal of I⁻¹          (1)   planned_experiment.hpp
//   promised sigma = s · sqrt((I(done) + I(next))⁻¹)             (2)   s: the latest fit's sigma / that of (1)
//   reachable sigma = s · sqrt((I(done) + n Σ I(allowed))⁻¹)     (3)   n: runs that may still follow
//
// (3) is a bound: no n runs tell more than n of each choice. s takes up what (1) does not know of, such as a bias that
// wanders. The model is the latest one; before the first fit it is the one in use. Allowed is what stays within the
// limits of the profile on that model, and of the station. Pure. Errors: throws std::invalid_argument quoting the bad
// value.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/identification/planned_experiment.hpp"
#include "control/models/plant_models.hpp"
#include "server/experiments/profile.hpp"

namespace server::experiments {

// What is known of the robot when a run is chosen.
struct Known {
  control::FractionalModel model;
  std::optional<double> sigma;  // of the parameter, by a fit of what was done; none: no fit, or not determined
  // Of what is fitted: the acceleration, or a position that is measured. Before a fit any size serves.
  double noise_sd = 1;
  bool is_of_acceleration = true;
};

struct Promise {
  Variant variant;
  std::optional<double> sigma;  // (2); none: it would not be determined
  std::string forbidden;        // why it is not allowed, in words; empty: it is
};

struct NextExcitation {
  std::optional<Variant> next;            // none: nothing is allowed
  std::optional<double> promised_sigma;   // (2)
  std::optional<double> reachable_sigma;  // (3)
  std::vector<Promise> promises;          // in the order of variants_of()
};

// What one of variants_of() tells, on the model. One takes up to a second, where its step is long.
struct Candidate {
  control::ExpectedInformation information{control::FractionalModel{}};
  std::string forbidden;  // as of Promise
};
Candidate candidate_of(const Profile& profile, const Variant& variant, const Known& known);

// `candidates`: of all of variants_of(). `done`: the runs so far, which are fewer than profile.most_runs.
NextExcitation next_excitation(const Profile& profile, const std::vector<Variant>& done, const Known& known,
                               const std::vector<Candidate>& candidates);

}  // namespace server::experiments
