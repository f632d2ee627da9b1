// A discrete transfer function, and the same as parallel sections, as the robot runs it.
//
//   G(z) = Σ b_k z^-k / Σ a_k z^-k,  a_0 = 1                                                                 (1)
//        = direct + Σ_i r_i/(1 - p_i z^-1) + Σ_j (b0_j + b1_j z^-1)/(1 + a1_j z^-1 + a2_j z^-2)             (2)
//   r_i p_i = b(p_i)/Π_{j≠i}(p_i - p_j),  b(z) = Σ b_k z^(n-k),  direct = b_n/a_n                           (3)
//   h_k = Σ_i g_i p_i^(k-1) for k ≥ 1:  Σ h_k² = h_0² + Σ_i Σ_j g_i g_j/(1 - p_i p_j)                       (4)
//
// Parallel sections keep their states apart, so that rounding to float32 costs 1.2 to 4 decades less than the direct
// forms do. A pair of complex poles becomes one second-order section. So does a real pole within 0.001 of 0 together
// with the direct term: by (3) both would be huge and cancel.
// What is asked of sections is computed from the poles themselves: with poles that crowd near 1 (short periods, high
// orders) no coefficients (1) in double hold the digits, however they are computed: discretise.hpp measures that.
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <expected>
#include <span>
#include <string>
#include <vector>

#include "control/models/transfer_function.hpp"

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

Complex discrete_response(const ParallelSections& sections, double period_s, double omega_rad_s);
double dc_gain(const ParallelSections& sections);
std::vector<Complex> poles(const ParallelSections& sections);
std::vector<Complex> zeros(const ParallelSections& sections);
double white_noise_gain(const ParallelSections& sections);  // (4), its root: sd of the output per sd of the input

// Poles must be distinct and inside the unit circle.
ParallelSections to_parallel_sections(const DiscreteTransferFunction& transfer);
// The same for those who have another try: the error says which poles have no such sections.
std::expected<ParallelSections, std::string> partial_fractions(const DiscreteTransferFunction& transfer);
DiscreteTransferFunction to_transfer_function(const ParallelSections& sections, double period_s);

// Adds (b0 + b1 z^-1)/(1 - pole z^-1).
void add_first_order(ParallelSections& sections, double b0, double b1, double pole);

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
