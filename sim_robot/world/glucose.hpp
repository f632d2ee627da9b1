// Glucose in the fluid, and the impedance that it makes: the paper's Appendix B.
//
//   Z = Z_nominal + (Z_glucose - Z_nominal) · min(1, Σ c)                                           (1)   mV
//   c(x, t) = C e^{-t/τ} [F((x - a)/σ) - F((x - b)/σ)],  σ² = edge² + 2 D t                         (2)
//
// A patch is poured from a to b with concentration C, 1 being the paper's mixture. It spreads by D (mixing), which
// keeps its amount, and fades by τ (decay), both from the time it was poured on. F is the normal distribution. A patch
// stays where it was poured: it is not carried along by the flow. Accuracy: F from a table, within 2e-5. Errors: throws
// std::invalid_argument quoting the bad value.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace sim_robot {

struct GlucosePatch {
  double position_m = 0;                                     // its middle, (a + b)/2
  double length_m = 0.1;                                     // b - a
  double concentration = 1;                                  // C
  double edge_m = 0;                                         // sd of the edges when poured; 0: sharp
  double mixing_m2_s = 0;                                    // D; 0: does not spread
  double decay_s = std::numeric_limits<double>::infinity();  // τ
  double poured_at_s = 0;                                    // time of the run
  double removed_at_s = std::numeric_limits<double>::infinity();
};

struct GlucoseParameters {
  double nominal_mv = 175;
  double glucose_mv = 120;  // at concentration 1
  std::vector<GlucosePatch> patches;
};

void check(const GlucosePatch& patch);
void check(const GlucoseParameters& parameters);

class Glucose {
 public:
  static constexpr std::size_t kMaxPatches = 100;  // each costs time in every tick

  explicit Glucose(const GlucoseParameters& parameters);

  void step();  // one tick

  // Adds a patch now, whatever its poured_at_s. Throws when kMaxPatches are there already.
  void pour(GlucosePatch patch);

  double time_s() const { return time_s_; }       // since it began, in which patches are removed
  double concentration(double position_m) const;  // Σ c
  double impedance_mv(double position_m) const;   // (1)

 private:
  struct Patch {
    double start_m, end_m;
    double strength, decay;         // C e^{-t/τ}, and its change in a tick
    double variance_m2, growth_m2;  // σ², and its change in a tick
    double poured_at_s, removed_at_s;
  };
  static Patch begun(const GlucosePatch& patch);

  double nominal_mv_, span_mv_;
  std::vector<Patch> patches_;
  double time_s_ = 0;
  long ticks_ = 0;
};

}  // namespace sim_robot
