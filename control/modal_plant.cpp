// Lays the modes out in blocks and advances them.
#include "control/modal_plant.hpp"

#include <cmath>
#include <numeric>

#include "control/invalid_argument.hpp"
#include "control/modal_form.hpp"

namespace control {
namespace {

constexpr ModalRange kRange{0.01, 1e5, 1e-6};
constexpr double kSettled = 1e-17;  // what is left of a mode after one step, when the next cannot see it

}  // namespace

ModalPlant::ModalPlant(const FractionalModel& model, double dt_s) : dt_s_(dt_s) {
  if (!(dt_s > 0 && std::isfinite(dt_s))) {
    throw_invalid("modal plant: dt_s must be positive and finite, is ", dt_s);
  }
  const ModalForm form = modal_form(model, kRange);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < form.rate.size(); ++i) {
    const Complex rate = form.rate[i], weight = 2.0 * form.weight[i];
    const double steady = -(weight / rate).real();
    position_per_travel_ += steady;
    const StepFactors factors = step_factors(rate, dt_s);
    if (std::abs(factors.decay) < kSettled) {
      velocity_at_once_ += steady;
      position_at_once_ -= (weight / rate / rate).real();
      continue;
    }
    const std::size_t lane = kept++ % kLanes;
    if (lane == 0) blocks_.emplace_back(), slopes_.emplace_back();
    Block& block = blocks_.back();
    const Complex input = weight * factors.integral, position = 1.0 / rate;
    block.decay_re[lane] = factors.decay.real(), block.decay_im[lane] = factors.decay.imag();
    block.input_re[lane] = input.real(), block.input_im[lane] = input.imag();
    block.position_re[lane] = position.real(), block.position_im[lane] = position.imag();
    slopes_.back().rate_re[lane] = rate.real(), slopes_.back().rate_im[lane] = rate.imag();
    slopes_.back().weight[lane] = weight.real();
  }
}

void ModalPlant::step(double duty) {
  Lanes velocity{}, position{};
  for (Block& block : blocks_) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const double re = block.state_re[i], im = block.state_im[i];
      block.state_re[i] = block.decay_re[i] * re - block.decay_im[i] * im + block.input_re[i] * duty;  // (2)
      block.state_im[i] = block.decay_re[i] * im + block.decay_im[i] * re + block.input_im[i] * duty;
      velocity[i] += block.state_re[i];
      position[i] += block.position_re[i] * block.state_re[i] - block.position_im[i] * block.state_im[i];
    }
  }
  duty_ = duty;
  travel_s_ += duty * dt_s_;
  velocity_m_s_ = std::accumulate(velocity.begin(), velocity.end(), velocity_at_once_ * duty);  // (1)
  position_m_ = std::accumulate(position.begin(), position.end(),
                                position_per_travel_ * travel_s_ + position_at_once_ * duty);  // (3)
}

double ModalPlant::acceleration_m_s2() const {
  double sum = 0;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const Block& block = blocks_[k];
    const Slope& slope = slopes_[k];
    for (std::size_t i = 0; i < kLanes; ++i) {
      sum += slope.rate_re[i] * block.state_re[i] - slope.rate_im[i] * block.state_im[i] + slope.weight[i] * duty_;
    }
  }
  return sum;
}

void ModalPlant::reset() {
  for (Block& block : blocks_) block.state_re = block.state_im = {};
  travel_s_ = duty_ = position_m_ = velocity_m_s_ = 0;
}

}  // namespace control
