// Fluids like that of (29): the same final velocity, b1 and b2 halved to doubled, orders 1.4 to 1.95 and 0.6 to 0.98.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "control/models/plant_models.hpp"

namespace control {

// All four numbers drawn at once, the same ones in every run.
inline std::vector<FractionalModel> fluid_family(int count, unsigned seed) {
  std::mt19937 random{seed};
  const auto between = [&random](double low, double high) { return std::uniform_real_distribution{low, high}(random); };
  std::vector<FractionalModel> fluids;
  for (int i = 0; i < count; ++i) {
    FractionalModel model = kNonNewtonianModel;
    model.b1 *= std::exp2(between(-1, 1));
    model.b2 *= std::exp2(between(-1, 1));
    model.alpha = between(1.4, 1.95);
    model.beta = between(0.6, 0.98);
    fluids.push_back(model);
  }
  return fluids;
}

// Every combination of ends and middles: 81.
inline std::vector<FractionalModel> fluid_family_corners() {
  std::vector<FractionalModel> fluids;
  for (const double b1 : {0.5, 1.0, 2.0}) {
    for (const double b2 : {0.5, 1.0, 2.0}) {
      for (const double alpha : {1.4, 1.7263, 1.95}) {
        for (const double beta : {0.6, 0.8682, 0.98}) {
          const FractionalModel& middle = kNonNewtonianModel;
          fluids.push_back({middle.kp, b1 * middle.b1, b2 * middle.b2, middle.b3, alpha, beta});
        }
      }
    }
  }
  return fluids;
}

}  // namespace control
