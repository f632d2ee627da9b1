#include "server/experiments/preview_band.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/invalid_argument.hpp"
#include "control/discretisation/estimator_model.hpp"
#include "control/responses/measured_spread.hpp"

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

control::LoopMotion motion_of(const Preview& preview, DutyRange duty) {
  control::LoopMotion motion{preview.duty, preview.velocity_m_s, {}};
  for (std::size_t k = 0; k < preview.duty.size(); ++k) {
    const bool is_auto = !std::isnan(preview.setpoint_m[k]);
    const bool is_clipped = preview.duty[k] <= duty.min || preview.duty[k] >= duty.max;
    motion.ticks.push_back(!is_auto     ? control::LoopTick::duty_given
                           : is_clipped ? control::LoopTick::clipped
                                        : control::LoopTick::acts);
  }
  return motion;
}

void set_model(control::EstimateParameters& estimate, const control::EstimatorSections& sections) {
  std::ranges::copy(sections.gain_m_s, estimate.gain_m_s.begin());
  std::ranges::copy(sections.time_constant_s, estimate.time_constant_s.begin());
}

control::EstimatorSections sections_of(const control::EstimateParameters& estimate) {
  const auto narrow = [](double value) { return static_cast<float>(value); };
  control::EstimatorSections sections;
  std::ranges::transform(estimate.gain_m_s, sections.gain_m_s.begin(), narrow);
  std::ranges::transform(estimate.time_constant_s, sections.time_constant_s.begin(), narrow);
  return sections;
}

// A confirmed model is the plant's own; else the plant's sections are found, well or badly: the loop alone needs them.
control::LoopParts parts_of(const BandRequest& request) {
  control::LoopParts parts{request.estimate, 0, {}, {}, request.controller};
  if (request.estimate.is_confirmed) {
    parts.gain_m_s = request.estimate.gain_m_s;
    parts.time_constant_s = request.estimate.time_constant_s;
    parts.model_error = control::fit_error(sections_of(request.estimate), request.plant);
    return parts;
  }
  control::EstimateParameters plant;
  set_model(plant, control::estimator_model(request.plant).sections);
  parts.gain_m_s = plant.gain_m_s;
  parts.time_constant_s = plant.time_constant_s;
  return parts;
}

}  // namespace

std::vector<double> parameters_sd_of(const Profile& profile, const TimeLine& line, const FractionalModel& plant,
                                     const control::ExpectedUncertainty& uncertainty,
                                     const control::ParallelSections& controller, DutyRange duty) {
  const auto positions = [&](const FractionalModel& model) {
    return preview_of(profile, line, model, controller, duty.min, duty.max).position_m;
  };
  const std::vector<double> middle_m = positions(plant);
  const std::size_t samples = middle_m.size();
  std::vector<std::vector<double>> deviations(control::kParameters);  // d_i of (2); empty: known
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
    sd_m[k] = std::sqrt(std::max(variance_m2, 0.0));  // (2)
  }
  return sd_m;
}

PositionBand band_of(const BandRequest& request) {
  const Preview preview =
      preview_of(request.profile, request.line, request.plant, request.controller, request.duty.min, request.duty.max);
  control::MeasuredSpread spread = control::measured_spread(motion_of(preview, request.duty), parts_of(request));
  PositionBand band;
  band.parameters_m = parameters_sd_of(request.profile, request.line, request.plant, request.uncertainty,
                                       request.controller, request.duty);
  band.estimator_m = std::move(spread.estimator_m);
  band.sensor_m = std::move(spread.sensor_m);
  band.start_m = std::move(spread.start_m);
  for (std::size_t k = 0; k < band.parameters_m.size(); ++k) {
    const double of_estimate_m = std::hypot(band.estimator_m[k], band.sensor_m[k], band.start_m[k]);
    band.sd_m.push_back(std::hypot(band.parameters_m[k], of_estimate_m));  // (1)
    band.true_sd_m.push_back(std::hypot(band.parameters_m[k], spread.true_m[k]));
  }
  return band;
}

control::EstimateParameters estimate_with(const FractionalModel& plant, bool is_in_grave_doubt) {
  control::EstimateParameters estimate;
  const control::EstimatorModel model = control::estimator_model(plant);
  estimate.is_confirmed = model.is_met && !is_in_grave_doubt;
  set_model(estimate, model.is_met ? model.sections : control::estimator_model(control::kNonNewtonianModel).sections);
  return estimate;
}

}  // namespace server::experiments
