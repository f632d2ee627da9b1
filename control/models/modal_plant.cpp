// Lays the modes out in blocks and advances them.
#include "control/models/modal_plant.hpp"

#include <cmath>
#include <numeric>

#include "base/invalid_argument.hpp"
#include "control/models/modal_form.hpp"

namespace control {
namespace {

constexpr ModalRange kRange{0.01, 1e5, 1e-6};
constexpr double kSettled = 1e-17;  // what is left of a mode after one step, when the next cannot see it

}  // namespace

ModalPlant::Modes::Modes(const FractionalModel& of_model, double of_dt_s) : model(of_model), dt_s(of_dt_s) {
  if (!(dt_s > 0 && std::isfinite(dt_s))) {
    base::throw_invalid("modal plant: dt_s must be positive and finite, is ", dt_s);
  }
  const ModalForm form = modal_form(model, kRange);
  const double earlier_s = DelayLine{model.dead_time_s, dt_s}.earlier_share() * dt_s, later_s = dt_s - earlier_s;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < form.rate.size(); ++i) {
    const Complex rate = form.rate[i], weight = 2.0 * form.weight[i];
    const double steady = -(weight / rate).real();
    position_per_travel += steady;
    const StepFactors factors = step_factors(rate, dt_s);
    const StepFactors later = earlier_s > 0 ? step_factors(rate, later_s) : factors;
    if (std::abs(later.decay) < kSettled) {
      velocity_at_once += steady;
      position_at_once -= (weight / rate / rate).real();
      continue;
    }
    const std::size_t lane = kept++ % kLanes;
    if (lane == 0) blocks.emplace_back(), slopes.emplace_back();
    if (lane == 0 && earlier_s > 0) earlier.emplace_back();
    Block& block = blocks.back();
    const Complex input = weight * later.integral, position = 1.0 / rate;  // (2), (4)
    if (earlier_s > 0) {
      const Complex before = weight * step_factors(rate, earlier_s).integral * later.decay;  // (4)
      earlier.back().input_re[lane] = before.real(), earlier.back().input_im[lane] = before.imag();
    }
    block.decay_re[lane] = factors.decay.real(), block.decay_im[lane] = factors.decay.imag();
    block.input_re[lane] = input.real(), block.input_im[lane] = input.imag();
    block.position_re[lane] = position.real(), block.position_im[lane] = position.imag();
    slopes.back().rate_re[lane] = rate.real(), slopes.back().rate_im[lane] = rate.imag();
    slopes.back().weight[lane] = weight.real();
  }
}

// Those of the plant before, as long as it or a copy of it lives and is of the same model.
std::shared_ptr<const ModalPlant::Modes> ModalPlant::modes_of(const FractionalModel& model, double dt_s) {
  thread_local std::weak_ptr<const Modes> latest;
  auto modes = latest.lock();
  if (!modes || modes->model != model || modes->dt_s != dt_s) {
    modes = std::make_shared<const Modes>(model, dt_s);
    latest = modes;
  }
  return modes;
}

ModalPlant::ModalPlant(const FractionalModel& model, double dt_s)
    : modes_(modes_of(model, dt_s)), states_(modes_->blocks.size()), delay_(model.dead_time_s, dt_s) {}

void ModalPlant::step(double duty) {
  const HeldDuty held = delay_.push(duty);
  modes_->earlier.empty() ? advance<false>(held) : advance<true>(held);
}

template <bool has_earlier>
void ModalPlant::advance(HeldDuty held) {
  Lanes velocity{}, position{};
  const double duty = held.later;
  const Block* block = modes_->blocks.data();
  const Earlier* earlier = modes_->earlier.data();
  for (State& state : states_) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const double re = state.re[i], im = state.im[i];
      state.re[i] = block->decay_re[i] * re - block->decay_im[i] * im + block->input_re[i] * duty;  // (2)
      state.im[i] = block->decay_re[i] * im + block->decay_im[i] * re + block->input_im[i] * duty;
      if constexpr (has_earlier) {
        state.re[i] += earlier->input_re[i] * held.earlier;  // (4)
        state.im[i] += earlier->input_im[i] * held.earlier;
      }
      velocity[i] += state.re[i];
      position[i] += block->position_re[i] * state.re[i] - block->position_im[i] * state.im[i];
    }
    ++block;
    if constexpr (has_earlier) ++earlier;
  }
  duty_ = duty;
  const double share = has_earlier ? delay_.earlier_share() : 0;
  travel_s_ += (share * held.earlier + (1 - share) * duty) * modes_->dt_s;
  velocity_m_s_ = std::accumulate(velocity.begin(), velocity.end(), modes_->velocity_at_once * duty);  // (1)
  position_m_ = std::accumulate(position.begin(), position.end(),
                                modes_->position_per_travel * travel_s_ + modes_->position_at_once * duty);  // (3)
}

double ModalPlant::acceleration_m_s2() const {
  double sum = 0;
  for (std::size_t k = 0; k < states_.size(); ++k) {
    const State& state = states_[k];
    const Slope& slope = modes_->slopes[k];
    for (std::size_t i = 0; i < kLanes; ++i) {
      sum += slope.rate_re[i] * state.re[i] - slope.rate_im[i] * state.im[i] + slope.weight[i] * duty_;
    }
  }
  return sum;
}

void ModalPlant::prefetch() const {
  static_assert(sizeof(State) == 64, "a line of the cache");
  for (const State& state : states_) __builtin_prefetch(&state, 1);
}

void ModalPlant::reset() {
  for (State& state : states_) state = {};
  delay_.reset();
  travel_s_ = duty_ = position_m_ = velocity_m_s_ = 0;
}

}  // namespace control
