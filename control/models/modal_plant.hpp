// Simulates the robot's motion as a sum of exponentials, exact for a duty that is constant between steps.
//
//   v = Σ_i 2 Re[y_i] + c u,  y_i' = s_i y_i + w_i u                 (1)   modal_form.hpp: H as modes s_i, w_i
//   y_i → e^{s_i dt} y_i + w_i (e^{s_i dt} - 1)/s_i u                (2)   over one step of constant duty u
//   x = ∫v dt = Σ_i 2 Re[y_i/s_i] - Σ_i 2 Re[w_i/s_i] ∫u dt          (3)   (1) divided by s_i and summed
//   With a dead time (2) becomes (4): a part f of the step under the earlier duty, the rest under the later one, see
//   delay_line.hpp.
//   y_i → e^{s_i dt} y_i + w_i (e^{s_i dt} - e^{s_i (1-f) dt})/s_i u_earlier + w_i (e^{s_i (1-f) dt} - 1)/s_i u_later
//
// Modes that settle within one step have no state: y = -w u/s, which makes c and its part of (3). Thus (3) makes the
// position one more weighted sum of the same states, and keeps it consistent with the velocity for days.
// Accuracy: velocity and position step responses within 2e-6 relative from 10 ms to a day, or 1e-14 of kp/b3 and of
//           kp/b3 ∫|u| dt where that is more (rounding), for every model that check() allows and every dt_s; before
//           10 ms within 2e-6 of the value at 10 ms. Held by modal_plant_test.cpp.
// Cost:     144 modes for (29), one pass over them per step. Plants of one model and dt_s share their constants (made
//           on one thread, one after the other), so that a thousand of them fit the cache: 2.3 kB each.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "control/models/delay_line.hpp"
#include "control/models/plant_models.hpp"

namespace control {

class ModalPlant {
 public:
  ModalPlant(const FractionalModel& model, double dt_s);

  // Advances by dt_s; the duty is constant over it, and acts the model's dead time later.
  void step(double duty);

  double position_m() const { return position_m_; }
  double velocity_m_s() const { return velocity_m_s_; }
  double acceleration_m_s2() const;  // at the end of the last step, under the duty that acts then

  void reset();
  // Asks for the memory of a step ahead of it.
  void prefetch() const;

 private:
  // Modes side by side, so that one instruction advances several; the last block is filled with zeros. y is 2 y_i.
  static constexpr std::size_t kLanes = 4;
  using Lanes = std::array<double, kLanes>;
  struct State {
    Lanes re{}, im{};  // y
  };
  struct Block {
    Lanes decay_re{}, decay_im{};        // y after dt, per y
    Lanes input_re{}, input_im{};        // y after dt, per u; with a dead time per u_later of (4)
    Lanes position_re{}, position_im{};  // 1/s of (3)
  };
  struct Earlier {
    Lanes input_re{}, input_im{};  // y after dt, per u_earlier of (4)
  };
  struct Slope {
    Lanes rate_re{}, rate_im{};  // s
    Lanes weight{};              // Re[2 w]
  };
  struct Modes {
    Modes(const FractionalModel& model, double dt_s);

    FractionalModel model;
    double dt_s;
    std::vector<Block> blocks;
    std::vector<Earlier> earlier;    // of the same modes; none where the dead time is a whole number of steps
    std::vector<Slope> slopes;       // for the acceleration, of the same modes
    double velocity_at_once = 0;     // c, m/s per duty
    double position_at_once = 0;     // -Σ 2 Re[w/s²] of the modes in c, m per duty
    double position_per_travel = 0;  // of (3), m per duty·s
  };
  static std::shared_ptr<const Modes> modes_of(const FractionalModel& model, double dt_s);

  template <bool has_earlier>
  void advance(HeldDuty duty);

  std::shared_ptr<const Modes> modes_;
  std::vector<State> states_;
  DelayLine delay_;
  double travel_s_ = 0;  // ∫u dt of what has acted
  double duty_ = 0;      // that acts at the end of the last step
  double position_m_ = 0;
  double velocity_m_s_ = 0;
};

}  // namespace control
