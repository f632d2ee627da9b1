// Patches lie where they were poured, mix without loss, fade, and change the impedance as Figure A2 shows.
#include "sim_robot/world/glucose.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

void pass(Glucose& glucose, double seconds) {
  for (int k = 0; k < std::lround(seconds / kTickS); ++k) glucose.step();
}

double amount(const Glucose& glucose) {
  double sum = 0;
  for (double position_m = -1; position_m < 2; position_m += 1e-4) sum += 1e-4 * glucose.concentration(position_m);
  return sum;
}

TEST(Glucose, WithoutItTheImpedanceIs175MvEverywhere) {
  const Glucose none{{}};
  for (const double position_m : {-1e3, 0.0, 0.3}) EXPECT_EQ(none.impedance_mv(position_m), 175);
}

TEST(Glucose, APatchIsWhereItWasPouredAndReads120Mv) {
  const Glucose glucose{{.patches = {{.position_m = 0.3, .length_m = 0.1}}}};
  EXPECT_EQ(glucose.impedance_mv(0.2499), 175);
  EXPECT_DOUBLE_EQ(glucose.impedance_mv(0.2501), 120);
  EXPECT_DOUBLE_EQ(glucose.impedance_mv(0.3499), 120);
  EXPECT_EQ(glucose.impedance_mv(0.3501), 175);
}

TEST(Glucose, CountsByItsConcentrationAndTwoPatchesAddUpToTheMixtureAtMost) {
  const Glucose half{{.patches = {{.concentration = 0.5}}}};
  EXPECT_DOUBLE_EQ(half.impedance_mv(0), 147.5);
  const Glucose more{{.patches = {{.concentration = 0.5}, {.concentration = 0.25}}}};
  EXPECT_DOUBLE_EQ(more.impedance_mv(0), 175 - 0.75 * 55);
  const Glucose full{{.patches = {{.concentration = 3}}}};
  EXPECT_DOUBLE_EQ(full.impedance_mv(0), 120);
}

TEST(Glucose, MixesWithoutLosingAny) {
  Glucose glucose{{.patches = {{.position_m = 0.5, .length_m = 0.2, .mixing_m2_s = 1e-4}}}};
  pass(glucose, 10);
  EXPECT_NEAR(amount(glucose), 0.2, 1e-5);
  pass(glucose, 90);
  EXPECT_NEAR(amount(glucose), 0.2, 1e-5);
  // The middle, of two normal distributions with sd sqrt(2 D t) = 0.1414 m.
  EXPECT_NEAR(glucose.concentration(0.5), std::erf(0.1 / std::sqrt(4 * 1e-4 * 100)), 1e-4);
  EXPECT_NEAR(glucose.concentration(0.5 - 0.2), glucose.concentration(0.5 + 0.2), 1e-9);
}

TEST(Glucose, FadesByItsTimeConstant) {
  Glucose glucose{{.patches = {{.decay_s = 20}}}};
  pass(glucose, 20);
  EXPECT_NEAR(glucose.concentration(0), std::exp(-1), 1e-9);
  EXPECT_NEAR(glucose.impedance_mv(0), 175 - 55 * std::exp(-1), 1e-6);
}

TEST(Glucose, MayHaveSoftEdgesFromTheStart) {
  const Glucose glucose{{.patches = {{.position_m = 0, .length_m = 1, .edge_m = 0.02}}}};
  EXPECT_NEAR(glucose.concentration(0.5), 0.5, 1e-5);
  EXPECT_NEAR(glucose.concentration(0.5 - 0.02), 0.841345, 2e-5);
  EXPECT_NEAR(glucose.concentration(0.5 + 0.02), 0.158655, 2e-5);
}

TEST(Glucose, IsThereFromWhenItIsPouredUntilItIsRemoved) {
  Glucose glucose{{.patches = {{.decay_s = 10, .poured_at_s = 5, .removed_at_s = 8}}}};
  pass(glucose, 4.99);
  EXPECT_EQ(glucose.concentration(0), 0);
  pass(glucose, 0.01);
  EXPECT_EQ(glucose.concentration(0), 1);  // fresh
  pass(glucose, 2.99);
  EXPECT_NEAR(glucose.concentration(0), std::exp(-0.299), 1e-9);
  pass(glucose, 0.01);
  EXPECT_EQ(glucose.concentration(0), 0);
}

TEST(Glucose, CanBePouredAtAnyTime) {
  Glucose glucose{{}};
  pass(glucose, 7);
  glucose.pour({.position_m = 1, .length_m = 0.2});
  EXPECT_EQ(glucose.concentration(1), 1);
  EXPECT_EQ(glucose.concentration(0), 0);
}

TEST(Glucose, RefusesWhatCannotBe) {
  EXPECT_THROW(check(GlucosePatch{.length_m = 0}), std::invalid_argument);
  EXPECT_THROW(check(GlucosePatch{.concentration = -1}), std::invalid_argument);
  EXPECT_THROW(check(GlucosePatch{.decay_s = 0}), std::invalid_argument);
  EXPECT_THROW(check(GlucosePatch{.poured_at_s = 2, .removed_at_s = 1}), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
