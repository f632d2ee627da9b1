// The duty of one step over time: staircase, ramp, chirp, PRBS, multisine. Pure.
//
//   chirp:     sin(2π f_0 L (e^{t/L} - 1)), L = T/ln(f_1/f_0): the frequency grows exponentially          (1)
//   multisine: Σ cos(2π f_k t - π k (k-1)/N), k = 1 … N: Schroeder's phases, for a low peak (IEEE Trans.
//              Inf. Theory 16, 1970, p. 85); f_k log-spaced, each rounded to whole periods in T            (2)
//
// Both are held for every_s and scaled so that their largest value is the amplitude at most.
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <cstdint>
#include <vector>

#include "server/experiments/profile.hpp"

namespace server::experiments {

struct DutyChange {
  std::uint64_t tick = 0;  // from the beginning of the step
  double duty = 0;         // from then on
  bool operator==(const DutyChange&) const = default;
};

// Ascending, the first at tick 0; without changes to the same duty. Not of a step that is_closed_loop().
std::vector<DutyChange> duty_changes(const Step& step);

// The duration of any step but a scan, whose duration depends on where it begins.
std::uint64_t ticks_of(const Step& step);

// Whole periods in for_s, ascending, each once (2).
std::vector<double> tone_frequencies_hz(const Step& step);

}  // namespace server::experiments
