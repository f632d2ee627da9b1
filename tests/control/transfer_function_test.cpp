// The plant and the controller are what their formulas say, on every sheet, and bad controllers are refused.
#include "control/models/transfer_function.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <tuple>

namespace control {
namespace {

using std::numbers::pi;

TEST(TransferFunction, OfIntegerOrderIsThePolynomial) {
  const Complex s{-3, 7};
  const Complex expected = 232.0 / (s * s + 60.13 * s + 667.1);
  EXPECT_LT(std::abs(velocity_transfer(kNewtonianModel, s) - expected), 1e-15);
}

TEST(TransferFunction, WithoutItsFirstTermIsALagWhateverAlphaIs) {
  const Complex s{0, 2};
  for (const double alpha : {1.1, 2.0}) {
    EXPECT_LT(std::abs(velocity_transfer({3, 0, 0.5, 1, alpha, 1}, s) - 3.0 / (1.0 + 0.5 * s)), 1e-15);
  }
}

TEST(TransferFunction, SlopeIsTheDerivativeAnywhereInTheCutPlane) {
  for (const double angle_rad : {0.0, pi / 2, -pi / 2, 3.0, -3.0}) {
    for (const double log_radius : {-3.0, 0.0, 4.0}) {
      const Complex log_s{log_radius, angle_rad}, s = std::exp(log_s), h = 1e-6 * s;
      const auto d = [](Complex at) { return denominator(kNonNewtonianModel, std::log(at)); };
      const Complex difference = (d(s + h) - d(s - h)) / (2.0 * h);
      const Complex slope = denominator_slope(kNonNewtonianModel, log_s);
      EXPECT_LT(std::abs(slope - difference), 1e-8 * (std::abs(slope) + 1 / std::abs(s)));
    }
  }
}

TEST(TransferFunction, PowersAreConjugateOnConjugatePoints) {
  const Complex s{-2, 5};
  EXPECT_LT(std::abs(controller_transfer(kPaperController, std::conj(s)) -
                     std::conj(controller_transfer(kPaperController, s))),
            1e-12);
  EXPECT_LT(std::abs(controller_transfer({2, 0.5, 1}, s) - 2.0 * (1.0 + 0.5 * s)), 1e-14);
}

TEST(FopdController, RefusesEveryBadParameterByItsName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::tuple<FopdController, const char*, const char*> bad[] = {
      {{0, 1, 0.5}, "kp", "0"},   {{-2, 1, 0.5}, "kp", "-2"},   {{nan, 1, 0.5}, "kp", "nan"},
      {{1, -1, 0.5}, "kd", "-1"}, {{1, nan, 0.5}, "kd", "nan"}, {{1, 1, 0}, "mu", "0"},
      {{1, 1, 2}, "mu", "2"},     {{1, 1, nan}, "mu", "nan"}};
  for (const auto& [controller, name, value] : bad) {
    try {
      check(controller);
      ADD_FAILURE() << name << " = " << value << " was accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(std::string(name) + " must"));
      EXPECT_THAT(error.what(), testing::HasSubstr(value));
    }
  }
  EXPECT_NO_THROW(check(kPaperController));
  EXPECT_NO_THROW(check(FopdController{1, 0, 1}));
}

}  // namespace
}  // namespace control
