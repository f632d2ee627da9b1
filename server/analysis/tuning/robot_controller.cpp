// Strictly proper sections, written with a direct part.
#include "server/analysis/tuning/robot_controller.hpp"

#include <cmath>

namespace server::analysis {
namespace {

constexpr double kLeastA2 = 1e-8;  // in place of less: as near as the robot's float32

}  // namespace

control::ParallelSections sections_of(const protocol::Controller& controller) {
  control::ParallelSections sections;
  for (pb_size_t i = 0; i < controller.pole_count; ++i) {
    sections.second_order.push_back({0, controller.residue[i], -controller.pole[i], 0});
  }
  for (pb_size_t i = 0; i < controller.biquad_b0_count; ++i) {  // c + (-c + (b0 - c a1) w)/(1 + a1 w + a2 w²)
    const double a1 = controller.biquad_a1[i];
    const double given = controller.biquad_a2[i], a2 = std::abs(given) < kLeastA2 ? kLeastA2 : given;
    const double c = controller.biquad_b1[i] / a2;
    sections.second_order.push_back({-c, controller.biquad_b0[i] - c * a1, a1, a2});
  }
  sections.direct = static_cast<double>(controller.kp) - control::dc_gain(sections);
  return sections;
}

}  // namespace server::analysis
