#include "server/experiments/preview_band.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "base/invalid_argument.hpp"

namespace server::experiments {
namespace {

using control::FractionalModel;

double& parameter(FractionalModel& model, std::size_t index) {
  double* const parameters[control::kParameters] = {&model.kp, &model.b1, &model.b2, &model.alpha, &model.beta};
  return *parameters[index];
}

std::optional<FractionalModel> changed(FractionalModel model, std::size_t index, double by) {
  parameter(model, index) += by;
  try {
    control::check(model);
    return model;
  } catch (const std::invalid_argument&) {
    return std::nullopt;
  }
}

// Two models around the given one, or at the edge of what is allowed it and one beside it.
struct Pair {
  FractionalModel low, high;
  double distance = 0;
};

Pair pair_around(const FractionalModel& model, std::size_t index, double sigma) {
  constexpr int kHalvings = 30;
  double step = sigma;
  for (int i = 0; i < kHalvings; ++i, step /= 2) {
    const auto low = changed(model, index, -step), high = changed(model, index, step);
    if (low && high) return {*low, *high, 2 * step};
  }
  step = sigma;
  for (int i = 0; i < kHalvings; ++i, step /= 2) {
    if (const auto low = changed(model, index, -step)) return {*low, model, step};
    if (const auto high = changed(model, index, step)) return {model, *high, step};
  }
  base::throw_invalid("the uncertainty of ", control::kParameterNames[index], ", ", sigma, ", makes no other model");
}

}  // namespace

std::vector<double> position_sd_of(const Profile& profile, const TimeLine& line, const FractionalModel& plant,
                                   const control::ExpectedUncertainty& uncertainty,
                                   const control::ParallelSections& controller) {
  const auto positions = [&](const FractionalModel& model) {
    return preview_of(profile, line, model, controller).position_m;
  };
  const std::vector<double> middle_m = positions(plant);
  const std::size_t samples = middle_m.size();
  std::vector<std::vector<double>> deviations(control::kParameters);  // d_i of (1); empty: known
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    const double sigma = uncertainty.one_sigma[i].value_or(0);
    if (sigma == 0) continue;
    const Pair pair = pair_around(plant, i, sigma);
    const std::vector<double> low_m = positions(pair.low), high_m = positions(pair.high);
    deviations[i].resize(samples);
    for (std::size_t k = 0; k < std::min({samples, low_m.size(), high_m.size()}); ++k) {
      deviations[i][k] = (high_m[k] - low_m[k]) / pair.distance * sigma;
    }
  }
  std::vector<double> later_m;  // by one sd of the dead time
  if (uncertainty.dead_time_sd_s > 0) {
    FractionalModel late = plant;
    late.dead_time_s += uncertainty.dead_time_sd_s;
    later_m = positions(late);
  }
  std::vector<double> sd_m(samples);
  for (std::size_t k = 0; k < samples; ++k) {
    double variance_m2 = k < later_m.size() ? std::pow(later_m[k] - middle_m[k], 2) : 0;
    for (std::size_t i = 0; i < control::kParameters; ++i) {
      for (std::size_t j = 0; j < control::kParameters; ++j) {
        if (deviations[i].empty() || deviations[j].empty()) continue;
        const double correlation = i == j ? 1 : uncertainty.correlation[i][j];
        variance_m2 += correlation * deviations[i][k] * deviations[j][k];
      }
    }
    sd_m[k] = std::sqrt(std::max(variance_m2, 0.0));  // (1)
  }
  return sd_m;
}

}  // namespace server::experiments
