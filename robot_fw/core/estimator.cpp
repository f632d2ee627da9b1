// Integrates in every tick; compares with the model in every fifth, where the covariance's work is.
#include "robot_fw/core/estimator.hpp"

#include <algorithm>
#include <cmath>

namespace robot_fw {
namespace {

constexpr float kMaxDtS = 0.1F;
constexpr int kTicksPerMeasurement = 5;
constexpr int kStuckReadings = 25;            // equal ones in a row: with the noise, never by chance
constexpr float kStartVelocityM_S = 0.0005F;  // sd
constexpr float kGainWalk = 0.003F;           // sd of the gain's change in 1 s
constexpr float kLostM = 10;                  // sd of the position after a restart
constexpr float kLostM_S = 0.5F;              // of the velocity then; water's model reaches 0.35 m/s

// sd of the velocity that repeated and skipped readings cost, relative to a tick's change.
constexpr float kSlip = 0.15F;
// Of the model's change in a tick without a reading: sd, relative, and in m/s².
constexpr float kUnsensedShare = 0.3F;
constexpr float kUnsensedM_S2 = 0.02F;

// By how much the model may lag (sd; with the fluid's own model a reading's age is all), and for how long the error of
// its shape keeps its sign.
struct ModelDoubt {
  float lag_s, correlation_s;
};
constexpr ModelDoubt kOfTheFluid{0.004F, 0.1F}, kAssumed{0.025F, 0.5F};

constexpr float kRestingModelM_S = 0.0003F;  // below it the modelled velocity has died down
constexpr float kStillM_S2 = 0.01F;          // below it nothing is felt but noise and bias
constexpr float kDoubt = 0.6F;               // share of the doubtful way that is one sd

constexpr float kDriftPerFlow = 1.5F;    // sd of the mean flow, relative to the pulsation's rms
constexpr float kLastingS = 4;           // for so long what is seen in each window may have been there
constexpr float kDriftDecayPerS = 0.5F;  // once the flow is over

constexpr float kSurprising = 9;           // innovation squared by its variance
constexpr float kExpectedSurprise = 4;     // generously: the mean is 1
constexpr float kGreatestSurprise = 20;    // counted at once
constexpr float kMismatchSurprises = 60;   // summed
constexpr float kStrangeGain = 0.35F;      // surely beyond it, the gain is not that of the model's fluid
constexpr int kMismatchStrangeGains = 10;  // in a row

constexpr float kRounding = 1.1F;  // of a covariance that is sound, rounding changes no more: 0.5 % was seen

constexpr float square(float x) { return x * x; }

// 1 - e^-x as a fraction of polynomials: within 1e-5 for x ≤ 0.5, and in [0, 1.1] for all.
float decayed_share(float x) { return 12 * x / (12 + 6 * x + x * x); }

// Whether a covariance P may have this P Hᵀ and H P Hᵀ, by Cauchy and Schwarz: (P Hᵀ)_i² ≤ P_ii · H P Hᵀ. Where the
// model's gains all but cancel, rounding outgrows what is left of it.
template <std::size_t n>
bool may_be_one(const std::array<std::array<float, n>, n>& p, const std::array<float, n>& ph, float hph) {
  const float most = kRounding * hph;
  bool may_be = hph >= 0;
  for (std::size_t i = 0; i < n; ++i) may_be = may_be && square(ph[i]) <= most * p[i][i];
  return may_be;
}

}  // namespace

Estimator::Estimator(const EstimatorParameters& parameters, float position_sd_m) {
  set_parameters(parameters);
  start();
  covariance_[position][position] = square(position_sd_m);
  position_sd_m_ = position_sd_m;
}

bool Estimator::at_rest() const { return duty_ == 0 && std::fabs(model_m_s_) < kRestingModelM_S; }

void Estimator::set_parameters(const EstimatorParameters& parameters) {
  parameters_ = parameters;
  tuned_dt_s_ = steady_gain_m_s_ = 0;
  for (const float gain_m_s : parameters.model.gain_m_s) steady_gain_m_s_ += gain_m_s;
  section_.fill(0);
  model_m_s_ = surprises_ = 0;
  strange_gains_ = 0;
  mismatch_ = false;
  restart_gains();
  covariance_[bias][bias] = std::max(covariance_[bias][bias], square(parameters.bias_m_s2));
}

// What was found of the gains is forgotten.
void Estimator::restart_gains() {
  gain_change_m_s_.fill(0);
  for (std::size_t k = gain; k < kStates; ++k) {
    for (std::size_t i = 0; i < kStates; ++i) covariance_[k][i] = covariance_[i][k] = 0;
  }
  reopen_gain(square(parameters_.gain_error));
  if (parameters_.is_confirmed) return;
  for (std::size_t k = gain; k < kStates; ++k)
    covariance_[k][k] += square(parameters_.section_error * steady_gain_m_s_);
}

// All gains become unknown alike.
void Estimator::reopen_gain(float relative_variance) {
  const auto& gains = parameters_.model.gain_m_s;
  for (std::size_t i = 0; i < kModelSections; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      covariance_[gain + i][gain + j] += gains[i] * gains[j] * relative_variance;
      covariance_[gain + j][gain + i] = covariance_[gain + i][gain + j];
    }
  }
}

float Estimator::gain_error() const {
  float sum_m_s = 0;
  for (const float change_m_s : gain_change_m_s_) sum_m_s += change_m_s;
  return steady_gain_m_s_ == 0 ? 0 : sum_m_s / steady_gain_m_s_;
}

float Estimator::gain_variance() const {
  float sum = 0;
  for (std::size_t i = gain; i < kStates; ++i) {
    for (std::size_t j = gain; j < kStates; ++j) sum += covariance_[i][j];
  }
  return steady_gain_m_s_ == 0 ? 0 : std::max(sum, 0.0F) / square(steady_gain_m_s_);
}

void Estimator::start() {
  for (Vector& row : covariance_) row.fill(0);
  covariance_[velocity][velocity] = square(kStartVelocityM_S);
  covariance_[bias][bias] = square(parameters_.bias_m_s2);
  restart_gains();
  velocity_m_s_ = bias_m_s2_ = drift_m_s_ = 0;
  pulsation_.restart();
}

void Estimator::step(const EstimatorInputs& inputs) {
  if (!(inputs.dt_s > 0 && inputs.dt_s <= kMaxDtS)) return;
  tune_sections(inputs.dt_s);
  advance_model(inputs.duty);
  integrate(inputs);
  if (++interval_.ticks < kTicksPerMeasurement) return;
  propagate_covariance();
  if (flow_m_s() > 0) {
    admit_drift();
  } else {
    let_drift_die_down();
  }
  guard(compare_with_model());
  interval_ = {};
}

void Estimator::tune_sections(float dt_s) {
  if (dt_s == tuned_dt_s_) return;
  tuned_dt_s_ = dt_s;
  for (std::size_t i = 0; i < kModelSections; ++i) {
    section_share_[i] = decayed_share(dt_s / parameters_.model.time_constant_s[i]);
  }
}

// (1)
void Estimator::advance_model(float duty) {
  duty_ = std::isfinite(duty) ? std::clamp(duty, -1.0F, 1.0F) : 0;
  if (std::fabs(duty_) < parameters_.dead_zone_duty) duty_ = 0;
  if (duty_ != 0) still_s_ = 0;  // SAFETY: also without readings, the motor has ended what was felt before
  if (std::fabs(duty_) < parameters_.doubtful_duty) doubtful_m_ += steady_gain_m_s_ * duty_ * tuned_dt_s_;
  model_m_s_ = 0;
  for (std::size_t i = 0; i < kModelSections; ++i) {
    section_change_[i] = section_share_[i] * (duty_ - section_[i]);
    section_[i] += section_change_[i];
    model_m_s_ += (parameters_.model.gain_m_s[i] + gain_change_m_s_[i]) * section_[i];
  }
}

bool Estimator::has_reading(const EstimatorInputs& inputs) {
  if (!inputs.is_valid) return false;
  repeats_ = inputs.counts == last_counts_ ? std::min(repeats_ + 1, kStuckReadings) : 0;
  last_counts_ = inputs.counts;
  return repeats_ < kStuckReadings;
}

// (2)
void Estimator::integrate(const EstimatorInputs& inputs) {
  const float dt_s = inputs.dt_s;
  float explained_m_s = 0;
  for (std::size_t i = 0; i < kModelSections; ++i) {
    explained_m_s += (parameters_.model.gain_m_s[i] + gain_change_m_s_[i]) * section_change_[i];
  }
  float change_m_s = explained_m_s;
  if (has_reading(inputs)) {
    acceleration_m_s2_ = kMS2PerCount * static_cast<float>(inputs.counts) - bias_m_s2_;
    watch_stillness(acceleration_m_s2_, dt_s);
    change_m_s = dt_s * acceleration_m_s2_;  // of a reading 5 ms old in the mean: the middle of the tick
    interval_.sensed_s += dt_s;
    interval_.velocity_variance += square(parameters_.noise_m_s2 * dt_s) + square(kSlip * change_m_s);
    interval_.fastest_change_m_s2 = std::max(interval_.fastest_change_m_s2, std::fabs(acceleration_m_s2_));
  } else {
    for (std::size_t i = 0; i < kModelSections; ++i) interval_.modelled[i] += section_change_[i];
    interval_.velocity_variance += square(kUnsensedShare * explained_m_s) + square(kUnsensedM_S2 * dt_s);
  }
  position_m_ += dt_s * (velocity_m_s_ + 0.5F * change_m_s);
  velocity_m_s_ += change_m_s;
  interval_.duration_s += dt_s;
  const bool may_err = !parameters_.is_confirmed;
  pulsation_.step(change_m_s - explained_m_s, explained_m_s, dt_s,
                  {may_err ? parameters_.gain_error : 0, may_err ? kAssumed.lag_s : 0});
}

// Coasting, the robot feels the drag; at rest it feels the bias alone, which may not be known well yet.
void Estimator::watch_stillness(float reading_m_s2, float dt_s) {
  felt_m_s2_ += std::min(dt_s, 1.0F) * (reading_m_s2 - felt_m_s2_);
  still_s_ = duty_ == 0 && std::fabs(felt_m_s2_) < kStillM_S2 ? still_s_ + dt_s : 0;
}

// P → F P Fᵀ + Q, F - 1 having but the rows of position and velocity.
void Estimator::propagate_covariance() {
  const float t_s = interval_.duration_s, sensed_s = interval_.sensed_s;
  auto& p = covariance_;
  for (std::size_t j = 0; j < kStates; ++j) {
    p[position][j] += t_s * (p[velocity][j] - 0.5F * t_s * p[bias][j]);
    p[velocity][j] -= sensed_s * p[bias][j];
  }
  for (std::size_t i = 0; i < kStates; ++i) {
    p[i][position] += t_s * (p[i][velocity] - 0.5F * t_s * p[i][bias]);
    p[i][velocity] -= sensed_s * p[i][bias];
  }
  if (sensed_s < t_s) propagate_modelled();
  const float came_in = interval_.velocity_variance;
  p[position][position] += came_in * square(t_s) * (1.0F / 3);
  p[position][velocity] += came_in * t_s * 0.5F;
  p[velocity][position] = p[position][velocity];
  p[velocity][velocity] += came_in;
  p[bias][bias] += square(parameters_.bias_walk_m_s2) * t_s;
  reopen_gain(square(kGainWalk) * t_s);
}

// What the model's change stood in for, without readings.
void Estimator::propagate_modelled() {
  auto& p = covariance_;
  for (std::size_t k = 0; k < kModelSections; ++k) {
    for (std::size_t j = 0; j < kStates; ++j) p[velocity][j] += interval_.modelled[k] * p[gain + k][j];
  }
  for (std::size_t k = 0; k < kModelSections; ++k) {
    for (std::size_t i = 0; i < kStates; ++i) p[i][velocity] += interval_.modelled[k] * p[i][gain + k];
  }
}

void Estimator::let_drift_die_down() {
  drift_admitted_ = false;
  const float keep = 1 - std::min(kDriftDecayPerS * interval_.duration_s, 1.0F);
  drift_m_s_ *= keep;
  for (std::size_t i = 0; i < kStates; ++i) covariance_[drift][i] *= keep;
  for (std::size_t i = 0; i < kStates; ++i) covariance_[i][drift] *= keep;
}

// Velocity and drift become unknown alike, and with them the position since the flow may have begun.
void Estimator::admit_drift() {
  auto& p = covariance_;
  float since_s = 0;
  if (!drift_admitted_) {
    drift_admitted_ = true;
    since_s = kLastingS;
    surprises_ = 0;
    restart_gains();  // what the gains have learned was the flow
  }
  const float missing = square(kDriftPerFlow * flow_m_s()) - p[drift][drift];
  if (missing <= 0) return;
  const Vector along{since_s, 1, 0, 1};
  for (std::size_t i = 0; i < kStates; ++i) {
    for (std::size_t j = 0; j < kStates; ++j) p[i][j] += along[i] * along[j] * missing;
  }
}

// Of ε in (3), as white noise.
float Estimator::measurement_variance(bool is_confirmed) const {
  const bool is_assumed = !is_confirmed && !at_rest();
  const ModelDoubt& doubt = is_assumed ? kAssumed : kOfTheFluid;
  const float floor_m_s = at_rest() ? parameters_.resting_velocity_m_s : parameters_.driven_velocity_m_s;
  const float shape =
      square(parameters_.shape_error * model_m_s_) + square(doubt.lag_s * interval_.fastest_change_m_s2);
  const float misfit = is_assumed ? pulsation_.misfit() : 0;
  const float area = parameters_.correlation_s * (square(floor_m_s) + square(flow_m_s())) +
                     doubt.correlation_s * shape + kLastingS * misfit * square(model_m_s_);
  return 2 * area / interval_.duration_s;
}

// (3)
bool Estimator::compare_with_model() {
  auto& p = covariance_;
  const float innovation = model_m_s_ + drift_m_s_ - velocity_m_s_;
  const auto times_h = [this](const Vector& x) {
    float sum = x[velocity] - x[drift];
    for (std::size_t k = 0; k < kModelSections; ++k) sum -= section_[k] * x[gain + k];
    return sum;
  };
  Vector ph{};  // P Hᵀ
  for (std::size_t i = 0; i < kStates; ++i) ph[i] = times_h(p[i]);
  float variance = times_h(ph);                    // H P Hᵀ
  if (!may_be_one(p, ph, variance)) return false;  // SAFETY: what comes of such a one is certain of anything
  const float surprise = surprise_ = square(innovation) / (variance + measurement_variance(true));
  variance += measurement_variance(parameters_.is_confirmed);
  const bool moving = std::fabs(model_m_s_) > kRestingModelM_S;
  if (surprise > kSurprising && moving && flow_m_s() == 0 && gain_variance() < 1) {  // the gain is quite another
    float nominal_m_s = 0;
    for (std::size_t k = 0; k < kModelSections; ++k) nominal_m_s += parameters_.model.gain_m_s[k] * section_[k];
    const float reopened = std::min(square(innovation / nominal_m_s), 4.0F);
    reopen_gain(reopened);
    for (std::size_t k = 0; k < kModelSections; ++k)
      ph[gain + k] -= parameters_.model.gain_m_s[k] * nominal_m_s * reopened;
    variance += square(nominal_m_s) * reopened;
  }
  const float by_variance = 1 / variance;
  Vector gains{};
  for (std::size_t i = 0; i < kStates; ++i) gains[i] = ph[i] * by_variance;
  correct(gains, ph, variance, innovation);
  watch_model(surprise);
  return true;
}

// The covariance in Joseph's form, (1 - K H) P (1 - K H)ᵀ + K R Kᵀ, multiplied out.
void Estimator::correct(const Vector& gains, const Vector& ph, float variance, float innovation) {
  position_m_ += gains[position] * innovation;
  velocity_m_s_ += gains[velocity] * innovation;
  bias_m_s2_ += gains[bias] * innovation;
  for (std::size_t k = 0; k < kModelSections; ++k) gain_change_m_s_[k] += gains[gain + k] * innovation;
  drift_m_s_ += gains[drift] * innovation;
  auto& p = covariance_;
  for (std::size_t i = 0; i < kStates; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      p[i][j] += gains[i] * (gains[j] * variance - ph[j]) - ph[i] * gains[j];
      p[j][i] = p[i][j];
    }
  }
}

void Estimator::watch_model(float surprise) {
  const float more = std::min(surprise, kGreatestSurprise) - kExpectedSurprise;
  surprises_ = std::clamp(surprises_ + more, 0.0F, 2 * kMismatchSurprises);
  const float gain_sd = std::sqrt(gain_variance());
  const bool strange = std::fabs(gain_error()) - 2 * gain_sd > kStrangeGain;
  strange_gains_ = strange ? std::min(strange_gains_ + 1, kMismatchStrangeGains) : 0;
  const bool begins = surprises_ > kMismatchSurprises || strange_gains_ == kMismatchStrangeGains;
  const bool ends = surprises_ == 0 && !strange;
  mismatch_ = mismatch_ ? !ends : begins;
}

void Estimator::guard(bool sound) {
  sound = sound && std::isfinite(position_m_) && std::isfinite(velocity_m_s_) && std::isfinite(bias_m_s2_) &&
          std::isfinite(gain_error()) && std::isfinite(drift_m_s_);
  for (std::size_t i = 0; i < kStates; ++i) {
    sound = sound && std::isfinite(covariance_[i][i]) && covariance_[i][i] >= 0;
    if (i < gain) covariance_[i][i] = std::max(covariance_[i][i], 1e-12F);
  }
  if (!sound) {
    start();
    if (!std::isfinite(position_m_)) position_m_ = 0;
    covariance_[position][position] = square(kLostM);
    covariance_[velocity][velocity] = square(kLostM_S);  // SAFETY: it may be moving
    surprises_ = 0;
  }
  position_sd_m_ = std::sqrt(covariance_[position][position] + square(kDoubt * doubtful_m_));
}

void Estimator::add_to(Crc32& crc) const {
  for (const float value : section_) crc.add_float(value);
  for (const float value : gain_change_m_s_) crc.add_float(value);
  for (const Vector& row : covariance_) {
    for (const float value : row) crc.add_float(value);
  }
  for (const float value :
       {position_m_, velocity_m_s_, bias_m_s2_, drift_m_s_, position_sd_m_, flow_m_s(), model_m_s_, doubtful_m_,
        pulsation_.unexplained_m_s(), pulsation_.explained_m_s(), pulsation_.misfit(), surprises_}) {
    crc.add_float(value);
  }
}

void Estimator::zero_position() {
  position_m_ = position_sd_m_ = doubtful_m_ = 0;
  for (std::size_t i = 0; i < kStates; ++i) covariance_[position][i] = covariance_[i][position] = 0;
}

}  // namespace robot_fw
