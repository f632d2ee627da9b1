// Draws models from the whole range that check() allows, for tests of what holds for every model.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "control/models/plant_models.hpp"

namespace control {

// Time scales from 1 ms to 3 hours, damping from 0.001 to 100, orders near and at the integers, and some with b1 = 0.
inline std::vector<FractionalModel> sample_models(unsigned seed, int count) {
  std::mt19937 random{seed};
  const auto draw = [&random] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<FractionalModel> models;
  for (int i = 0; i < count; ++i) {
    const double kind = draw(), drawn_beta = std::max(std::pow(draw(), 0.6), 0.03);
    const double beta = kind < 0.15 ? 1 : kind < 0.25 ? 0.98 : drawn_beta;
    const double order_kind = draw(), drawn_alpha = beta + (2 - beta) * (0.01 + 0.99 * draw());
    const double alpha = order_kind < 0.15 ? 2 : order_kind < 0.25 ? 1.98 : drawn_alpha;
    const double scale_s = std::pow(10, -3 + 7 * draw()), damping = std::pow(10, -3 + 5 * draw());
    const double b3 = std::pow(10, -3 + 6 * draw()), b1 = draw() < 0.1 ? 0 : b3 * std::pow(scale_s, alpha);
    models.push_back({draw() < 0.5 ? 0.1 : -3.0, b1, 2 * damping * b3 * std::pow(scale_s, beta), b3, alpha, beta});
  }
  return models;
}

}  // namespace control
