// Tells what goes on pulsating in the velocity beside the model: a flow, or an error of the model.
//
// In windows of 1 s, of the velocity's pulsation (slower changes than 0.5 s left out, or a move would be one):
//   u = unexplained by the model,  e = explained,  e' = its change in a tick
//   misfit = what k e and l e' explain of u,  |k| ≤ gain error, |l| ≤ lag: each by least squares
//   flow = √(u² - misfit),  misfit relative to e²: each the least of the last three windows, since a move ends sooner
// A flow has nothing to do with what the motor does; an error of the model follows the model (decision 0092). Where no
// error is allowed, all of u² is a flow's.
#pragma once

#include <array>

namespace robot_fw {

class PulsationWatch {
 public:
  // The largest error that the model may have: of its gain, relative, and its lag. Zeros: it has none.
  struct Allowed {
    float gain_error = 0, lag_s = 0;
  };

  // The changes of the velocity in a tick, in m/s.
  void step(float unexplained_m_s, float explained_m_s, float dt_s, const Allowed& allowed);
  void restart() { unexplained_m_s_ = explained_m_s_ = 0; }  // the windows stay

  float flow_m_s() const { return flow_m_s_; }  // rms; 0: none seen
  float misfit() const { return misfit_; }      // squared, relative to the model's pulsation
  float unexplained_m_s() const { return unexplained_m_s_; }
  float explained_m_s() const { return explained_m_s_; }

 private:
  // Integrals over a window, in (m/s)² s: of squares, and of u's products with the other two.
  struct Window {
    float duration_s = 0;
    float unexplained = 0, model = 0, change = 0;
    float with_model = 0, with_change = 0;
  };

  float unexplained_m_s_ = 0, explained_m_s_ = 0;
  Window window_;  // under way
  std::array<float, 3> flows_{}, misfits_{};
  float flow_m_s_ = 0, misfit_ = 0;
};

}  // namespace robot_fw
