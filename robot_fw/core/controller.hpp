// Fractional PD controllers, executed as parallel first- and second-order sections; and the two built-in ones.
//
//   C(s) = 65.0028 (1 + 0.0305 s^0.6524)                                   (30) of the paper
//   C(s) = 29.9712 (1 + 0.105235 s^0.945500)                               (4)   for a motor without reverse
//   u = direct · e + Σ residue_i · x_i + Σ y_j                                 (1)
//       x_i[k+1] = pole_i · x_i[k] + e[k]
//       y_j = b0 · w_j[k-1] + b1 · w_j[k-2],   w_j[k] = e[k] - a1 · w_j[k-1] - a2 · w_j[k-2]
//   C(z = 1) = direct + Σ residue_i/(1 - pole_i) + Σ (b0 + b1)/(1 + a1 + a2) = kp    (2)
//   u = kp · e + (C - kp) · (y_0 - y)      with the derivative on the measurement     (3)
//
//   e → error_m, reference less position in m;  y → position_m, y_0 the first one after a reset
//   u → requested duty, not yet limited;  sampling period 10 ms
// The states are driven by the error (or, in (3), the position) alone. The limited duty is never written back: with
// some coefficients that locks the motor for ever, and without an integrator there is nothing to wind up. In (3) a
// change of the setpoint acts through kp alone. C - kp has no gain at DC, so that y_0 only makes the
// sections start as if the robot had always been there.
// Accuracy: the sections are the order 5 fits of (30) by the direct method with a = 0.5, with (2) at most 1.2 % and
// 0.25 deg off below 30 rad/s, and of (4) with a = 0, 1.1 % and 0.4 deg off up to 6 rad/s. Differs from the paper:
// `direct` is corrected so that (2) holds exactly; the fit of (30) alone has C(1) = 65.59. (4) is not in the paper: it
// is tuned to 3 rad/s and 90 degrees, iso-damped, so that the robot, which cannot move back, hardly overshoots
// (docs/control.md). With a = 0 all residues are negative: the duty after a step of the error never changes its
// sign.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "robot_fw/core/crc32.hpp"

namespace robot_fw {

constexpr std::size_t kMaxSections = 10;  // a biquad counts as two
constexpr std::size_t kMaxCoefficients = 2 * kMaxSections;

struct Biquad {
  float b0 = 0, b1 = 0, a1 = 0, a2 = 0;
};

// Of a controller with at most kMaxSections.
struct ControllerSections {
  std::uint32_t controller_id = 0;
  std::uint32_t checksum = 0;  // as the station gave it; 0: not computed
  float kp = 0;
  float direct = 0;  // as designed; the controller executes (2)
  // Pole and residue of each real section, then b0, b1, a1 and a2 of each biquad.
  std::array<float, kMaxCoefficients> coefficients{};
  std::uint8_t count = 0;  // of real sections
  std::uint8_t biquad_count = 0;
  bool derivative_on_measurement = false;
  float duty_min = -1;  // in [-1, 0]
  float duty_max = 1;   // in (0, 1]

  constexpr float pole(std::size_t i) const { return coefficients[2 * i]; }
  constexpr float residue(std::size_t i) const { return coefficients[2 * i + 1]; }
  constexpr Biquad biquad(std::size_t j) const {
    const std::size_t b0 = 2U * count + 4 * j;
    return {coefficients[b0], coefficients[b0 + 1], coefficients[b0 + 2], coefficients[b0 + 3]};
  }
};

inline constexpr ControllerSections kPaperController{1,
                                                     0,
                                                     65.0028F,
                                                     117.11186F,
                                                     {-0.464926381F, -29.9971855F,  //
                                                      -0.102256174F, -14.5876807F,  //
                                                      0.438034375F, -5.32587518F,   //
                                                      0.822226735F, -1.00519276F,   //
                                                      0.970840994F, -0.0781306414F},
                                                     5};

// (4), as `rheonaut tune --crossover-rad-s 3 --phase-margin-deg 90` and `discretise --method direct --a 0` make it.
inline constexpr ControllerSections kOneWayController{1000,  // outside the ids that people choose, from 2 on
                                                      0,
                                                      29.971237F,
                                                      275.274536F,
                                                      {0.00472445041F, -216.798706F,  //
                                                       0.276149809F, -12.4680691F,    //
                                                       0.64420408F, -2.42204237F,     //
                                                       0.880512714F, -0.313556492F,   //
                                                       0.976423144F, -0.0193156041F},
                                                      5};

// The controller of a robot until another is set; duty_min is that of its motor.
constexpr const ControllerSections& built_in_controller(float duty_min) {
  return duty_min < 0 ? kPaperController : kOneWayController;
}

// The direct term for which (2) holds; not finite where some section has no DC gain.
float corrected_direct(const ControllerSections& sections);

// A controller's duty before and after its own limits.
struct ControllerDuty {
  float asked = 0;
  float limited = 0;
};

class Controller {
 public:
  explicit Controller(const ControllerSections& sections);

  // The duty for this sample; call once per period.
  ControllerDuty step(float error_m, float position_m);
  void reset();
  void add_to(Crc32& crc) const;  // its state

  const ControllerSections& sections() const { return sections_; }

 private:
  float drive_sections(float input_m);

  ControllerSections sections_;
  float direct_;
  std::array<float, kMaxSections> state_{};  // x_i, then w_j[k-1] and w_j[k-2] of each biquad
  bool has_origin_ = false;
  float origin_m_ = 0;  // y_0
};

}  // namespace robot_fw
