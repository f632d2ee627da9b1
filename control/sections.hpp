// A discrete transfer function, and the same as parallel sections, which is how the robot runs it.
//
//   G(z) = Σ b_k z^-k / Σ a_k z^-k,  a_0 = 1                                         (1)
//        = direct + Σ_i r_i/(1 - p_i z^-1) + Σ_j (c0_j + c1_j z^-1)/(1 + a1_j z^-1 + a2_j z^-2)   (2)   partial
//        fractions
//
// Parallel sections keep their states apart, so that rounding to float32 costs 1.2 to 4 decades less than the direct
// forms do (FINDINGS of the project, section 5). A pair of complex poles becomes one second-order section.
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <span>
#include <vector>

#include "control/transfer_function.hpp"

namespace control {

struct DiscreteTransferFunction {
  std::vector<double> numerator;    // b, ascending powers of 1/z
  std::vector<double> denominator;  // a, same length, a[0] = 1
  double period_s = 0.01;
};

Complex discrete_response(const DiscreteTransferFunction& transfer, double omega_rad_s);
double dc_gain(const DiscreteTransferFunction& transfer);
std::vector<Complex> poles(const DiscreteTransferFunction& transfer);
std::vector<Complex> zeros(const DiscreteTransferFunction& transfer);

struct FirstOrderSection {
  double pole = 0;
  double residue = 0;  // y = r u + p y_old
};

struct SecondOrderSection {
  double b0 = 0, b1 = 0;  // numerator b0 + b1 z^-1
  double a1 = 0, a2 = 0;  // denominator 1 + a1 z^-1 + a2 z^-2
};

struct ParallelSections {
  double direct = 0;
  std::vector<FirstOrderSection> first_order;
  std::vector<SecondOrderSection> second_order;
};

// Poles must be distinct and inside the unit circle.
ParallelSections to_parallel_sections(const DiscreteTransferFunction& transfer);
DiscreteTransferFunction to_transfer_function(const ParallelSections& sections, double period_s);

// The controller as the robot runs it: states driven by the error alone, the clamped duty never written back.
class SectionFilter {
 public:
  explicit SectionFilter(ParallelSections sections);
  double step(double error);
  void reset();

 private:
  ParallelSections sections_;
  std::vector<double> first_order_state_;
  std::vector<double> second_order_state_;  // two per section
};

// RMS difference in duty between the sections in float32 and in double, for this error signal.
double float32_rms_error(const ParallelSections& sections, std::span<const double> error_m);

}  // namespace control
