// One closed-loop prediction per row.
#include "control/robustness.hpp"

#include <algorithm>
#include <cmath>

#include "control/modal_plant.hpp"

namespace control {
namespace {

constexpr double kRestS = 40;
constexpr int kMostSamples = 20'000;

FractionalModel scaled(FractionalModel plant, double gain) {
  plant.kp *= gain;
  return plant;
}

RobustnessRow predict_row(const std::string& name, const FractionalModel& plant, double duty_min,
                          const Discretisation& controller) {
  ClosedLoopExperiment experiment;
  experiment.plant = plant;
  experiment.controller = controller.sections;
  experiment.period_s = controller.options.period_s;
  experiment.duty_min = duty_min;
  const ClosedLoopPrediction prediction = predict_closed_loop(experiment);
  return {name, plant, duty_min, experiment.duty_max, prediction.step, prediction.disturbance};
}

// White noise on the position reaches the unclamped duty through one linear filter: the root of its Σ h².
double noise_to_duty(const FractionalModel& plant, const Discretisation& controller) {
  ModalPlant motion{plant, controller.options.period_s};
  SectionFilter filter{controller.sections};
  const int samples = std::min(kMostSamples, static_cast<int>(std::ceil(kRestS / controller.options.period_s)));
  double sum = 0;
  for (int k = 0; k < samples; ++k) {
    const double duty = filter.step(-motion.position_m() - (k == 0 ? 1 : 0));
    motion.step(duty);
    sum += duty * duty;
  }
  return std::sqrt(sum);
}

}  // namespace

RobustnessTable robustness(const FractionalModel& plant, const Discretisation& controller) {
  RobustnessTable table;
  for (const double duty_min : {-1.0, 0.0}) {
    table.rows.push_back(predict_row("gain -30 %", scaled(plant, 0.7), duty_min, controller));
    table.rows.push_back(predict_row("as modelled", plant, duty_min, controller));
    table.rows.push_back(predict_row("gain +30 %", scaled(plant, 1.3), duty_min, controller));
    table.rows.push_back(predict_row("water (28)", kNewtonianModel, duty_min, controller));
  }
  table.duty_sd_per_noise_sd = noise_to_duty(plant, controller);
  return table;
}

}  // namespace control
