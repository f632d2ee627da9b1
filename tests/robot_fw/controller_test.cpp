// The controller is the golden order 5 fit of Eq (30), with a DC gain of exactly kp.
#include "robot_fw/core/controller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "control/discretisation/discretise.hpp"
#include "control/tuning/tune.hpp"
#include "tests/robot_fw/controllers.hpp"

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
    double pole = kPaperController.pole(i), slope = 1;
    for (int newton = 0; newton < 20; ++newton) {
      slope = 0;
      for (std::size_t k = 0; k + 1 < a.size(); ++k) slope = slope * pole + a[k] * static_cast<double>(5 - k);
      pole -= polynomial(a, pole) / slope;
    }
    const double residue = polynomial(b, pole) / slope;  // of b/a in z, where a is 0
    EXPECT_NEAR(kPaperController.pole(i), pole, 1e-7);
    EXPECT_NEAR(kPaperController.residue(i), residue, 1e-6 * std::abs(residue));
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
    const auto got = static_cast<double>(controller.step(static_cast<float>(error_m), 0).asked);
    ASSERT_NEAR(got, duty - excess * error_m, 2e-5) << "sample " << k;
  }
}

// Made by our own tools, so that anybody can make it again.
TEST(OneWayController, IsWhatTuneAndDiscretiseMakeOf3RadPerSAnd90Degrees) {
  const control::TuningResult tuned = control::tune(control::kNonNewtonianModel, {3, 90});
  ASSERT_TRUE(tuned.is_feasible);
  control::DiscretisationOptions options;
  options.a = 0;
  control::ParallelSections made = control::discretise(tuned.tuned->controller, options).sections;
  EXPECT_FLOAT_EQ(kOneWayController.kp, static_cast<float>(tuned.tuned->controller.kp));
  ASSERT_EQ(kOneWayController.count, made.first_order.size());
  ASSERT_TRUE(made.second_order.empty());
  std::ranges::sort(made.first_order, {}, &control::FirstOrderSection::pole);
  double direct = made.direct;  // r/(1 - p/z) is r + rp/(z - p), which is how the robot runs it
  for (std::size_t i = 0; i < kOneWayController.count; ++i) {
    const auto& [pole, residue] = made.first_order[i];
    direct += residue;
    EXPECT_FLOAT_EQ(kOneWayController.pole(i), static_cast<float>(pole));
    EXPECT_FLOAT_EQ(kOneWayController.residue(i), static_cast<float>(residue * pole));
  }
  EXPECT_FLOAT_EQ(kOneWayController.direct, static_cast<float>(direct));
}

TEST(OneWayController, IsBuiltInWhereTheMotorHasNoReverse) {
  EXPECT_EQ(&built_in_controller(0), &kOneWayController);
  EXPECT_EQ(&built_in_controller(-1), &kPaperController);
  EXPECT_EQ(&built_in_controller(-0.1F), &kPaperController);
}

// A setpoint behind the robot never gives the motor a tick forwards.
TEST(OneWayController, AnswersAStepOfTheErrorWithoutChangingItsSign) {
  Controller controller{kOneWayController};
  float before = controller.step(-0.1F, 0).asked;
  for (int k = 0; k < 1000; ++k) {
    const float duty = controller.step(-0.1F, 0).asked;
    ASSERT_LT(duty, 0) << k;
    ASSERT_GE(duty, before - 1e-5F) << k;
    before = duty;
  }
}

TEST(OneWayController, HasADcGainOfExactlyKp) {
  Controller controller{kOneWayController};
  float duty = 0;
  for (int k = 0; k < 2000; ++k) duty = controller.step(0.1F, 0).asked;
  EXPECT_NEAR(duty, 2.9971237F, 1e-4F);
}

TEST(Controller, HasADcGainOfExactlyKp) {
  Controller controller{kPaperController};
  float duty = 0;
  for (int k = 0; k < 2000; ++k) duty = controller.step(0.1F, 0).asked;
  EXPECT_NEAR(duty, 6.50028F, 1e-5F);
}

TEST(Controller, ForgetsEverythingOnReset) {
  Controller controller{kPaperController};
  const float first = controller.step(0.1F, 0).asked;
  controller.step(0.05F, 0);
  controller.reset();
  EXPECT_EQ(controller.step(0.1F, 0).asked, first);
}

ControllerSections biquads() {
  ControllerSections sections = sections_of(biquad_controller());
  sections.derivative_on_measurement = false;
  return sections;
}

// The same transfer function in double precision, section by section, as the protocol writes it.
TEST(Controller, RunsBiquadsAsTheProtocolDefinesThem) {
  Controller controller{biquads()};
  const double direct = 30 + 3 / 0.5 - 0.375 / 0.125;  // DC gain of exactly kp
  double x = 0, y1 = 0, y2 = 0, e1 = 0, e2 = 0;
  for (int k = 0; k < 500; ++k) {
    const double e = std::sin(0.3 * k) * std::exp(-0.01 * k);
    const double y = 0.25 * e1 + 0.125 * e2 + 1.5 * y1 - 0.625 * y2;
    const auto got = static_cast<double>(controller.step(static_cast<float>(e), 0).asked);
    ASSERT_NEAR(got, direct * e - 3 * x + y, 2e-5) << k;
    x = 0.5 * x + e;
    y2 = y1, y1 = y, e2 = e1, e1 = e;
  }
}

TEST(Controller, HasItsDcGainWithBiquadsAndWithTheDerivativeOnTheMeasurement) {
  for (const bool on_measurement : {false, true}) {
    ControllerSections sections = biquads();
    sections.derivative_on_measurement = on_measurement;
    Controller controller{sections};
    float duty = 0;
    for (int k = 0; k < 2000; ++k) duty = controller.step(0.01F, 0.09F).asked;
    EXPECT_NEAR(duty, 0.3F, 1e-5F);
  }
}

TEST(Controller, WithTheDerivativeOnTheMeasurementASetpointActsThroughKpAlone) {
  ControllerSections sections = kPaperController;
  sections.derivative_on_measurement = true;
  Controller controller{sections};
  EXPECT_FLOAT_EQ(controller.step(0.01F, 0.5F).asked, 0.650028F);  // wherever it starts
  EXPECT_FLOAT_EQ(controller.step(0.02F, 0.5F).asked, 1.300056F);
}

// With the setpoint at rest the two differ only by where they started: their answers to motion are the same.
TEST(Controller, AnswersToMotionAreTheSameWithTheDerivativeOnEither) {
  ControllerSections sections = kPaperController;
  Controller on_error{sections};
  sections.derivative_on_measurement = true;
  Controller on_measurement{sections};
  for (int k = 0; k < 500; ++k) {
    const float position_m = k == 0 ? 0 : 0.01F * std::sin(0.1F * static_cast<float>(k));
    ASSERT_NEAR(on_error.step(-position_m, position_m).asked, on_measurement.step(-position_m, position_m).asked,
                1e-5F);
  }
}

}  // namespace
}  // namespace robot_fw
