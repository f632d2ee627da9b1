// The scheme gives the reference values of the scheme, and comes nearer to the true response with smaller steps.
#include "control/models/grunwald_letnikov.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "control/responses/time_response.hpp"

namespace control {
namespace {

constexpr double kDuty = 0.3;

// At rest until the first sample, as in the reference.
std::vector<double> constant_duty(std::size_t count) {
  std::vector<double> duty(count, kDuty);
  duty.front() = 0;
  return duty;
}

void expect_reference(const char* key, std::size_t terms) {
  const auto reference = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/gl_scheme_reference.json"));
  const std::vector<double> velocity_m_s =
      grunwald_letnikov_velocity(kNonNewtonianModel, reference["h"], constant_duty(501), terms);
  for (std::size_t i = 0; i < reference["k"].size(); ++i) {
    const std::size_t k = reference["k"][i];
    const double expected = reference[key][i];
    EXPECT_NEAR(velocity_m_s[k], expected, 1e-10 * expected) << key << ", sample " << k;
  }
}

TEST(GrunwaldLetnikov, MeetsTheReferenceWithFullMemory) { expect_reference("full_memory", 0); }

TEST(GrunwaldLetnikov, MeetsTheReferenceWith100Terms) { expect_reference("short_memory_100_terms", 100); }

TEST(GrunwaldLetnikov, ErrsInProportionToTheStepSize) {
  const double once[] = {1.0};
  const double exact_m_s = step_response(kNonNewtonianModel, kDuty, once).velocity_m_s[0];
  const auto error_m_s = [&](std::size_t steps) {
    const std::vector<double> duty = constant_duty(steps + 1);
    return grunwald_letnikov_velocity(kNonNewtonianModel, 1.0 / static_cast<double>(steps), duty).back() - exact_m_s;
  };
  EXPECT_NEAR(error_m_s(500) / error_m_s(1000), 2, 0.02);
}

TEST(GrunwaldLetnikov, IsEmptyForNoSamples) {
  EXPECT_TRUE(grunwald_letnikov_velocity(kNonNewtonianModel, 0.01, {}).empty());
}

TEST(GrunwaldLetnikov, RefusesBadStepsDutiesAndModels) {
  const std::vector<double> good{0, 1}, bad{0, std::nan("")};
  EXPECT_THROW(grunwald_letnikov_velocity(kNonNewtonianModel, 0, good), std::invalid_argument);
  EXPECT_THROW(grunwald_letnikov_velocity(kNonNewtonianModel, -1, good), std::invalid_argument);
  EXPECT_THROW(grunwald_letnikov_velocity(kNonNewtonianModel, std::nan(""), good), std::invalid_argument);
  EXPECT_THROW(grunwald_letnikov_velocity(kNonNewtonianModel, 0.01, bad), std::invalid_argument);
  const std::vector<double> endless(200'001, 1.0);
  EXPECT_THROW(grunwald_letnikov_velocity(kNonNewtonianModel, 0.01, endless, 10), std::invalid_argument);
  FractionalModel model;
  model.beta = 1.5;
  EXPECT_THROW(grunwald_letnikov_velocity(model, 0.01, good), std::invalid_argument);
}

}  // namespace
}  // namespace control
