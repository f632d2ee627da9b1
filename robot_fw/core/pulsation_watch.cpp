// Sums windows, and judges them when they end.
#include "robot_fw/core/pulsation_watch.hpp"

#include <algorithm>
#include <cmath>

namespace robot_fw {
namespace {

constexpr float kLeakPerS = 2;                 // slower changes of velocity are no pulsation
constexpr float kWindowS = 1;                  // longer than a period of the pump
constexpr float kLeastFlowM_S = 0.004F;        // rms; the noise gives less
constexpr float kLeastModelPulsation = 1e-4F;  // (m/s)² s of a window, below which the model's error is not judged

constexpr float square(float x) { return x * x; }

// The part of a signal's square that a multiple of another one, up to `most`, explains: from their product and that
// one's square.
float explained_part(float product, float square_of_other, float most) {
  if (square_of_other <= 0) return 0;
  const float multiple = std::clamp(product / square_of_other, -most, most);
  return multiple * (2 * product - multiple * square_of_other);
}

}  // namespace

void PulsationWatch::step(float unexplained_m_s, float explained_m_s, float dt_s, const Allowed& allowed) {
  unexplained_m_s_ += unexplained_m_s - unexplained_m_s_ * dt_s * kLeakPerS;
  explained_m_s_ += explained_m_s - explained_m_s_ * dt_s * kLeakPerS;
  window_.duration_s += dt_s;
  window_.unexplained += square(unexplained_m_s_) * dt_s;
  window_.model += square(explained_m_s_) * dt_s;
  window_.change += square(explained_m_s) * dt_s;
  window_.with_model += unexplained_m_s_ * explained_m_s_ * dt_s;
  window_.with_change += unexplained_m_s_ * explained_m_s * dt_s;
  if (window_.duration_s < kWindowS) return;
  const float misfit = std::min(explained_part(window_.with_model, window_.model, allowed.gain_error) +
                                    explained_part(window_.with_change, window_.change, allowed.lag_s / dt_s),
                                window_.unexplained);
  flows_ = {flows_[1], flows_[2], (window_.unexplained - misfit) / window_.duration_s};
  misfits_ = {misfits_[1], misfits_[2], misfit / (window_.model + kLeastModelPulsation)};
  window_ = {};
  const float flow = *std::min_element(flows_.begin(), flows_.end());
  flow_m_s_ = flow > square(kLeastFlowM_S) ? std::sqrt(flow) : 0;
  misfit_ = *std::min_element(misfits_.begin(), misfits_.end());
}

}  // namespace robot_fw
