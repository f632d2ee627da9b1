// One closed-loop prediction per row.
#include "control/tuning/robustness.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "control/models/modal_plant.hpp"

namespace control {
namespace {

constexpr double kRestS = 40;
constexpr double kFewestSamples = 2000, kMostSamples = 20'000;
constexpr double kDecayed = 1e-3, kRounding = 1e-12, kExploded = 1e6;  // of the largest duty; of the first

FractionalModel scaled(FractionalModel plant, double gain) {
  plant.kp *= gain;
  return plant;
}

// Whether this impulse response dies away: its last quarter is small, and smaller than the one before.
bool has_decayed(std::span<const double> duty) {
  const auto largest = [](std::span<const double> part) {
    double result = 0;
    for (const double value : part) result = std::max(result, std::abs(value));
    return result;
  };
  const std::size_t quarter = duty.size() / 4;
  const double whole = largest(duty), last = largest(duty.last(quarter));
  const double last_but_one = largest(duty.last(2 * quarter).first(quarter));
  return last <= kDecayed * whole && last <= std::max(last_but_one, kRounding * whole);
}

// White noise on the position reaches the unclamped duty through one linear filter: the root of its Σ h². None if the
// loop is not stable.
std::optional<double> noise_to_duty(const FractionalModel& plant, const Discretisation& controller) {
  ModalPlant motion{plant, controller.options.period_s};
  SectionFilter filter{controller.sections};
  const double samples = std::clamp(std::ceil(kRestS / controller.options.period_s), kFewestSamples, kMostSamples);
  std::vector<double> duty;
  double sum = 0;
  while (static_cast<double>(duty.size()) < samples) {
    duty.push_back(filter.step(-motion.position_m() - (duty.empty() ? 1 : 0)));
    if (!(std::abs(duty.back()) <= kExploded * (std::abs(duty.front()) + controller.dc_gain))) return std::nullopt;
    motion.step(duty.back());
    sum += duty.back() * duty.back();
  }
  if (!has_decayed(duty)) return std::nullopt;
  return std::sqrt(sum);
}

RobustnessRow predict_row(const std::string& name, const FractionalModel& plant, double duty_min,
                          const Discretisation& controller) {
  ClosedLoopExperiment experiment;
  experiment.plant = plant;
  experiment.controller = controller.sections;
  experiment.period_s = controller.options.period_s;
  experiment.duty_min = duty_min;
  const ClosedLoopPrediction prediction = predict_closed_loop(experiment);
  return {name,
          plant,
          duty_min,
          experiment.duty_max,
          prediction.step,
          prediction.disturbance,
          noise_to_duty(plant, controller).has_value(),
          prediction.is_diverging};
}

}  // namespace

RobustnessTable robustness(const FractionalModel& plant, const Discretisation& controller) {
  FractionalModel water = kNewtonianModel;
  water.dead_time_s = plant.dead_time_s;  // of the robot, not of the fluid
  RobustnessTable table;
  for (const double duty_min : {-1.0, 0.0}) {
    table.rows.push_back(predict_row("gain -30 %", scaled(plant, 0.7), duty_min, controller));
    table.rows.push_back(predict_row("as modelled", plant, duty_min, controller));
    table.rows.push_back(predict_row("gain +30 %", scaled(plant, 1.3), duty_min, controller));
    table.rows.push_back(predict_row("water (28)", water, duty_min, controller));
  }
  table.duty_sd_per_noise_sd = noise_to_duty(plant, controller);
  return table;
}

}  // namespace control
