// Parallel sections are the same controller as the transfer function they come from.
#include "control/responses/sections.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>

namespace control {
namespace {

DiscreteTransferFunction golden_set(const char* name) {
  const auto golden = nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/fopd_discrete_order5.json"));
  const auto& set = golden["reference_sets"][name];
  return {set["b"], set["a"], 0.01};
}

// The output of the difference equation of (1), for an impulse.
std::vector<double> impulse_response(const DiscreteTransferFunction& transfer, std::size_t samples) {
  std::vector<double> h(samples, 0);
  for (std::size_t k = 0; k < samples; ++k) {
    if (k < transfer.numerator.size()) h[k] = transfer.numerator[k];
    for (std::size_t i = 1; i < transfer.denominator.size() && i <= k; ++i) h[k] -= transfer.denominator[i] * h[k - i];
  }
  return h;
}

void expect_same_response(const DiscreteTransferFunction& transfer, const ParallelSections& sections, double within) {
  SectionFilter filter{sections};
  double sum = 0;
  for (const double expected : impulse_response(transfer, 2000)) {
    ASSERT_NEAR(filter.step(sum == 0 ? 1 : 0), expected, within);
    sum += expected * expected;
  }
  EXPECT_NEAR(white_noise_gain(sections), std::sqrt(sum), within * std::sqrt(sum) + within);
  for (const double omega : {0.0, 1.0, 30.0, 200.0}) {
    const Complex exact = discrete_response(transfer, omega);
    EXPECT_LT(std::abs(discrete_response(sections, transfer.period_s, omega) - exact),
              within * std::abs(exact) + within);
  }
}

TEST(Sections, OfTheReferenceControllerHaveTheKnownPolesAndResidues) {
  const ParallelSections sections = to_parallel_sections(golden_set("dk_a0.5_M2048"));
  EXPECT_NEAR(sections.direct, -76.605, 1e-3);
  EXPECT_TRUE(sections.second_order.empty());
  ASSERT_EQ(sections.first_order.size(), 5U);
  const std::vector<std::pair<double, double>> expected{
      {-0.46493, 64.5203}, {-0.10226, 142.658}, {0.43803, -12.1586}, {0.82223, -1.22253}, {0.97084, -0.0804773}};
  for (const auto& [pole, residue] : expected) {
    const bool is_there = std::ranges::any_of(sections.first_order, [&](const FirstOrderSection& s) {
      return std::abs(s.pole - pole) < 1e-5 && std::abs(s.residue / residue - 1) < 1e-5;
    });
    EXPECT_TRUE(is_there) << pole;
  }
}

TEST(Sections, AnswerAnImpulseAsTheReferenceTransferFunctionsDo) {
  for (const char* name : {"dk_a0_M2048", "dk_a0.5_M2048", "dk_a0.9_M2048", "oustaloup5_0.1_1000_tustin"}) {
    SCOPED_TRACE(name);
    const DiscreteTransferFunction transfer = golden_set(name);
    expect_same_response(transfer, to_parallel_sections(transfer), 1e-8);
  }
}

TEST(Sections, AnswerAsRandomTransferFunctionsWithRealAndComplexPolesDo) {
  std::mt19937 generator{7};
  std::uniform_real_distribution<double> radius(0.2, 0.95), angle(0.3, 2.8), value(-5, 5);
  for (int round = 0; round < 50; ++round) {
    ParallelSections sections{value(generator), {}, {}};
    for (const double sign : {-1.0, 1.0}) sections.first_order.push_back({sign * radius(generator), value(generator)});
    const Complex pole = std::polar(radius(generator), angle(generator));
    sections.second_order.push_back({value(generator), value(generator), -2 * pole.real(), std::norm(pole)});
    const DiscreteTransferFunction transfer = to_transfer_function(sections, 0.01);
    ASSERT_EQ(transfer.numerator.size(), transfer.denominator.size());
    expect_same_response(transfer, sections, 1e-9);
    const ParallelSections again = to_parallel_sections(transfer);
    EXPECT_EQ(again.second_order.size(), 1U);
    expect_same_response(transfer, again, 1e-8);
    EXPECT_NEAR(dc_gain(again), dc_gain(transfer), 1e-8 * (1 + std::abs(dc_gain(transfer))));
  }
}

TEST(Sections, HaveTheZerosOfTheirTransferFunction) {
  const DiscreteTransferFunction transfer = golden_set("dk_a0.5_M2048");
  double largest = 0;
  for (const Complex zero : zeros(to_parallel_sections(transfer))) {
    largest = std::max(largest, std::abs(zero));
    Complex value = 0;
    for (const double b : transfer.numerator) value = value * zero + b;
    EXPECT_LT(std::abs(value), 1e-7);
  }
  EXPECT_NEAR(largest, 0.9720252716870408, 1e-9);
  EXPECT_EQ(zeros(transfer).size(), 5U);
}

TEST(Sections, KeepAPoleAtZeroTogetherWithTheDirectTerm) {
  const DiscreteTransferFunction difference{{3, -2}, {1, 0}, 0.01},
      near_zero{{3, -2, 1}, {1, -0.5 + 1e-9, -5e-10}, 0.01};
  for (const auto& transfer : {difference, near_zero}) {
    const ParallelSections sections = to_parallel_sections(transfer);
    EXPECT_EQ(sections.direct, 0);
    EXPECT_EQ(sections.second_order.size(), 1U);
    expect_same_response(transfer, sections, 1e-9);
  }
}

TEST(Sections, CostFarLessInFloat32ThanTheDutyResolves) {
  std::vector<double> error_m;
  for (int k = 0; k < 2000; ++k) error_m.push_back(0.1 * std::exp(-0.03 * k));
  EXPECT_LT(float32_rms_error(to_parallel_sections(golden_set("dk_a0.5_M2048")), error_m), 3e-6);
}

TEST(SectionFilter, StartsAgainFromRestAfterReset) {
  SectionFilter filter{to_parallel_sections(golden_set("dk_a0.5_M2048"))};
  const double first = filter.step(1);
  filter.step(1);
  filter.reset();
  EXPECT_EQ(filter.step(1), first);
}

TEST(Sections, RefuseWhatHasNoSuchForm) {
  EXPECT_THROW(to_parallel_sections({{1, 0}, {1, -1.1}, 0.01}), std::invalid_argument);
  EXPECT_THROW(to_parallel_sections({{1, 0, 0}, {1, -1, 0.25}, 0.01}), std::invalid_argument);
  EXPECT_THROW(to_parallel_sections({{1, 2, 3}, {1, 0, 0}, 0.01}), std::invalid_argument);
  EXPECT_THROW(to_parallel_sections({{1}, {1, 0.5}, 0.01}), std::invalid_argument);
  EXPECT_THROW(to_parallel_sections({{1, 0}, {2, 0.5}, 0.01}), std::invalid_argument);
  EXPECT_THROW(to_parallel_sections({{1, 0}, {1, std::nan("")}, 0.01}), std::invalid_argument);
  EXPECT_THROW(to_parallel_sections({{1, 0}, {1, 0.5}, 0}), std::invalid_argument);
  EXPECT_THROW(float32_rms_error({}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace control
