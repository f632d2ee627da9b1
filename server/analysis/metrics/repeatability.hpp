// Statistics of one figure over repeated runs.
//
//   repeatability limit = t(0.975; n - 1) √2 s_r: of two further runs in the same conditions 95 % differ by less
//   confidence: mean ± t(0.975; n - 1) s_r/√n                                                          Student's t
// ISO 5725-6, 4.1.4 has 2.8 s_r, which is the limit for very many runs: with two it would hold in 70 % of cases.
// Pure.
#pragma once

#include <optional>
#include <span>

namespace server::analysis {

struct Repeatability {
  std::size_t runs = 0;  // that have the figure
  std::optional<double> mean;
  // None for fewer than two runs.
  std::optional<double> sd;  // s_r, the repeatability standard deviation
  std::optional<double> confidence_half_width, repeatability_limit;
};

Repeatability repeatability_of(std::span<const std::optional<double>> values);

}  // namespace server::analysis
