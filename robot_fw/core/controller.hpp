// The fractional PD controller of the paper, executed as parallel first-order sections.
//
//   C(s) = 65.0028 (1 + 0.0305 s^0.6524)                                   (30) of the paper
//   u = direct · e + Σ residue_i · x_i,   x_i[k+1] = pole_i · x_i[k] + e[k]    (1)
//   C(z = 1) = direct + Σ residue_i/(1 - pole_i) = kp                        (2)
//
//   e → error_m, reference less position in m;  u → duty wanted, not yet limited;  sampling period 10 ms
// The states are driven by the error alone. The limited duty is never written back: with some coefficients that
// locks the motor for ever, and without an integrator there is nothing to wind up.
// Accuracy: the sections are the order 5 fit of (30), with (2) at most 1.2 % and 0.25 deg off below 30 rad/s.
// Differs from the paper: `direct` is corrected so that (2) holds exactly; the fit alone has C(1) = 65.59.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace robot_fw {

constexpr std::size_t kMaxSections = 10;

struct ControllerSections {
  std::uint32_t controller_id = 0;
  float kp = 0;
  std::array<float, kMaxSections> pole{};
  std::array<float, kMaxSections> residue{};
  std::size_t count = 0;
};

constexpr ControllerSections kPaperController{1,
                                              65.0028F,
                                              {-0.464926381F, -0.102256174F, 0.438034375F, 0.822226735F, 0.970840994F},
                                              {-29.9971855F, -14.5876807F, -5.32587518F, -1.00519276F, -0.0781306414F},
                                              5};

class Controller {
 public:
  explicit Controller(const ControllerSections& sections);

  // The duty wanted for this sample's error; call once per period.
  float step(float error_m);
  void reset() { state_.fill(0); }

  std::uint32_t controller_id() const { return sections_.controller_id; }

 private:
  ControllerSections sections_;
  float direct_;
  std::array<float, kMaxSections> state_{};
};

}  // namespace robot_fw
