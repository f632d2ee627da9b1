// The controller is the golden order 5 fit of Eq (30), with a DC gain of exactly kp.
#include "robot_fw/core/controller.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

namespace robot_fw {
namespace {

nlohmann::json reference_set() {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/fopd_discrete_order5.json"));
  return golden["reference_sets"]["dk_a0.5_M2048"];
}

// The value of c0 + c1 z^-1 + ... times z^order.
double polynomial(const std::vector<double>& coefficients, double z) {
  double value = 0;
  for (const double c : coefficients) value = value * z + c;
  return value;
}

TEST(Controller, HasThePolesAndResiduesOfTheGoldenFit) {
  const auto golden = reference_set();
  const std::vector<double> b = golden["b"], a = golden["a"];
  ASSERT_EQ(kPaperController.count, 5u);
  for (std::size_t i = 0; i < kPaperController.count; ++i) {
    double pole = kPaperController.pole[i], slope = 1;
    for (int newton = 0; newton < 20; ++newton) {
      slope = 0;
      for (std::size_t k = 0; k + 1 < a.size(); ++k) slope = slope * pole + a[k] * static_cast<double>(5 - k);
      pole -= polynomial(a, pole) / slope;
    }
    const double residue = polynomial(b, pole) / slope;  // of b/a in z, where a is 0
    EXPECT_NEAR(kPaperController.pole[i], pole, 1e-7);
    EXPECT_NEAR(kPaperController.residue[i], residue, 1e-6 * std::abs(residue));
  }
}

TEST(Controller, FollowsTheGoldenRecurrenceButForItsDcGain) {
  const auto golden = reference_set();
  const std::vector<double> b = golden["b"], a = golden["a"];
  const double excess = golden["dc"].get<double>() - 65.0028;
  Controller controller{kPaperController};
  std::vector<double> memory(b.size(), 0);
  for (int k = 0; k < 2000; ++k) {
    const double error_m = 0.1 * std::exp(-0.01 * k) * std::cos(0.05 * k);
    const double duty = b[0] * error_m + memory[0];
    for (std::size_t i = 1; i < b.size(); ++i) {
      memory[i - 1] = b[i] * error_m - a[i] * duty + (i + 1 < b.size() ? memory[i] : 0);
    }
    const auto got = static_cast<double>(controller.step(static_cast<float>(error_m)));
    ASSERT_NEAR(got, duty - excess * error_m, 2e-5) << "sample " << k;
  }
}

TEST(Controller, HasADcGainOfExactlyKp) {
  Controller controller{kPaperController};
  float duty = 0;
  for (int k = 0; k < 2000; ++k) duty = controller.step(0.1F);
  EXPECT_NEAR(duty, 6.50028F, 1e-5F);
}

TEST(Controller, ForgetsEverythingOnReset) {
  Controller controller{kPaperController};
  const float first = controller.step(0.1F);
  controller.step(0.05F);
  controller.reset();
  EXPECT_EQ(controller.step(0.1F), first);
}

}  // namespace
}  // namespace robot_fw
