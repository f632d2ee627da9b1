// Lets patches spread and fade, and reads them at a place.
#include "sim_robot/world/glucose.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/invalid_argument.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

constexpr double kFarSd = 5;
constexpr int kPerSd = 50;
constexpr double kHalfTickS = kTickS / 2;  // times are compared with this room for rounding

// F on [-kFarSd, kFarSd], linear in between.
double normal_distribution(double z) {
  static const auto kTable = [] {
    std::array<double, 2 * static_cast<int>(kFarSd) * kPerSd + 2> table{};
    for (std::size_t k = 0; k < table.size(); ++k) {
      table[k] = 0.5 * std::erfc((kFarSd - static_cast<double>(k) / kPerSd) / std::numbers::sqrt2);
    }
    return table;
  }();
  if (z <= -kFarSd) return 0;
  if (z >= kFarSd) return 1;
  const double at = (z + kFarSd) * kPerSd;
  const auto k = static_cast<std::size_t>(at);
  return std::lerp(kTable[k], kTable[k + 1], at - static_cast<double>(k));
}

}  // namespace

void check(const GlucosePatch& patch) {
  if (!std::isfinite(patch.position_m)) base::throw_invalid("glucose: position_m is ", patch.position_m);
  if (!base::is_positive(patch.length_m)) {
    base::throw_invalid("glucose: length_m must be positive and finite, is ", patch.length_m);
  }
  base::check_not_negative("glucose", "concentration", patch.concentration);
  base::check_not_negative("glucose", "edge_m", patch.edge_m);
  base::check_not_negative("glucose", "mixing_m2_s", patch.mixing_m2_s);
  base::check_not_negative("glucose", "poured_at_s", patch.poured_at_s);
  if (!(patch.decay_s > 0)) base::throw_invalid("glucose: decay_s must be positive, is ", patch.decay_s);
  if (!(patch.removed_at_s >= patch.poured_at_s)) {
    base::throw_invalid("glucose: removed_at_s ", patch.removed_at_s, " is before poured_at_s ", patch.poured_at_s);
  }
}

void check(const GlucoseParameters& parameters) {
  base::check_not_negative("glucose", "nominal_mv", parameters.nominal_mv);
  base::check_not_negative("glucose", "glucose_mv", parameters.glucose_mv);
  for (const GlucosePatch& patch : parameters.patches) check(patch);
}

Glucose::Patch Glucose::begun(const GlucosePatch& patch) {
  check(patch);
  return {patch.position_m - patch.length_m / 2,
          patch.position_m + patch.length_m / 2,
          patch.concentration,
          std::exp(-kTickS / patch.decay_s),
          patch.edge_m * patch.edge_m,
          2 * patch.mixing_m2_s * kTickS,
          patch.poured_at_s,
          patch.removed_at_s};
}

Glucose::Glucose(const GlucoseParameters& parameters)
    : nominal_mv_(parameters.nominal_mv), span_mv_(parameters.glucose_mv - parameters.nominal_mv) {
  check(parameters);
  for (const GlucosePatch& patch : parameters.patches) patches_.push_back(begun(patch));
}

void Glucose::pour(GlucosePatch patch) {
  std::erase_if(patches_, [this](const Patch& each) { return time_s_ >= each.removed_at_s - kHalfTickS; });
  if (patches_.size() >= kMaxPatches) {
    base::throw_invalid("glucose: there are ", patches_.size(), " patches, more are not allowed");
  }
  patch.poured_at_s = time_s_;
  patches_.push_back(begun(patch));
}

void Glucose::step() {
  time_s_ = kTickS * static_cast<double>(++ticks_);
  for (Patch& patch : patches_) {
    if (patch.poured_at_s > time_s_ - kHalfTickS) continue;
    patch.strength *= patch.decay;
    patch.variance_m2 += patch.growth_m2;
  }
}

double Glucose::concentration(double position_m) const {
  double sum = 0;
  for (const Patch& patch : patches_) {
    if (time_s_ < patch.poured_at_s - kHalfTickS || time_s_ >= patch.removed_at_s - kHalfTickS) continue;
    if (patch.variance_m2 == 0) {
      if (position_m > patch.start_m && position_m < patch.end_m) sum += patch.strength;
      continue;
    }
    const double per_sd = 1 / std::sqrt(patch.variance_m2);
    sum += patch.strength * (normal_distribution((position_m - patch.start_m) * per_sd) -
                             normal_distribution((position_m - patch.end_m) * per_sd));  // (2)
  }
  return sum;
}

double Glucose::impedance_mv(double position_m) const {
  return nominal_mv_ + span_mv_ * std::min(1.0, concentration(position_m));  // (1)
}

}  // namespace sim_robot
