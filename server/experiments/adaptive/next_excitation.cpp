#include "server/experiments/adaptive/next_excitation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "control/identification/planned_experiment.hpp"
#include "server/experiments/preview.hpp"

namespace server::experiments {
namespace {

control::PlannedExperiment planned(const std::vector<double>& duty, const Known& known) {
  control::PlannedExperiment experiment;
  experiment.dt_s = kTick_s;
  experiment.duty = duty;
  (known.is_of_acceleration ? experiment.acceleration_sd_m_s2 : experiment.position_sd_m) = known.noise_sd;
  experiment.fits_offset = !known.is_of_acceleration;
  return experiment;
}

bool is_same(const Variant& a, const Variant& b) { return a.step == b.step && a.duty_factor == b.duty_factor; }

}  // namespace

Candidate candidate_of(const Profile& profile, const Variant& variant, const Known& known) {
  Candidate candidate{control::ExpectedInformation{known.model}, ""};
  const Profile of_run = profile_of_run(profile, variant);
  const Preview preview = preview_of(of_run, time_line_of(profile, variant), known.model, {});
  if (!preview.problems.empty()) candidate.forbidden = preview.problems.front();
  candidate.information.add(planned(preview.duty, known));
  return candidate;
}

NextExcitation next_excitation(const Profile& profile, const std::vector<Variant>& done, const Known& known,
                               const std::vector<Candidate>& candidates) {
  const std::size_t parameter = profile.until.value().parameter;
  const std::vector<Variant> choices = variants_of(profile);
  control::ExpectedInformation so_far{known.model};
  for (const Variant& run : done) {
    const auto choice = std::ranges::find_if(choices, [&run](const Variant& one) { return is_same(one, run); });
    so_far.add(candidates.at(static_cast<std::size_t>(choice - choices.begin())).information);
  }
  const std::optional<double> expected = so_far.uncertainty().one_sigma[parameter];
  const double scale = known.sigma && expected ? *known.sigma / *expected : 1;
  const auto sigma_after = [&](const control::ExpectedInformation& more, int times) -> std::optional<double> {
    control::ExpectedInformation all = so_far;
    all.add(more, times);
    const std::optional<double> sigma = all.uncertainty().one_sigma[parameter];
    return sigma ? std::optional{scale * *sigma} : std::nullopt;
  };

  NextExcitation found;
  control::ExpectedInformation allowed{known.model};
  for (std::size_t i = 0; i < choices.size(); ++i) {
    found.promises.push_back({choices[i], sigma_after(candidates[i].information, 1), candidates[i].forbidden});
    const Promise& promise = found.promises.back();
    if (!promise.forbidden.empty()) continue;
    allowed.add(candidates[i].information);
    const bool is_better =
        !found.next || (promise.sigma && (!found.promised_sigma || *promise.sigma < *found.promised_sigma));
    if (!is_better) continue;
    found.next = choices[i];
    found.promised_sigma = promise.sigma;
  }
  const int may_follow = static_cast<int>(profile.most_runs) - static_cast<int>(done.size());
  if (found.next) found.reachable_sigma = sigma_after(allowed, may_follow);
  return found;
}

}  // namespace server::experiments
