// Approximates the fractional PD controller by Oustaloup's poles and zeros, mapped to discrete time by Tustin's rule.
//
//   s^μ ≈ ω_h^μ Π_{k=1..n} (s + ω'_k)/(s + ω_k),  ω'_k, ω_k = ω_b (ω_h/ω_b)^((2k - 1 ∓ μ)/2n)       (1)
//        = ω_h^μ (1 + Σ ρ_k/(s + ω_k)),  ρ_k = (ω'_k - ω_k) Π_{j≠k} (ω'_j - ω_k)/(ω_j - ω_k)       (2)
//   s = c (1 - z^-1)/(1 + z^-1),  c = 2/T:  1/(s + ω) = (1 + z^-1)/((c + ω)(1 - p z^-1)),  p = (c - ω)/(c + ω)   (3)
//
// (2), (3) give the sections without ever forming a polynomial, so that no digits are lost with poles near 1. For
// μ > 1 the zeros overlap the poles; the slope still holds on average. The poles are stable for every μ and T.
#pragma once

#include "control/responses/sections.hpp"

namespace control {

struct OustaloupBand {
  double low_rad_s = 0.1;    // ω_b
  double high_rad_s = 1000;  // ω_h
};

ParallelSections oustaloup_tustin(const FopdController& controller, const OustaloupBand& band, int order,
                                  double period_s);

}  // namespace control
