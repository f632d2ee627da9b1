// Discrete controllers agree with the reference fits, and say how well they fit.
#include "control/discretisation/discretise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <regex>
#include <stdexcept>
#include <string>

namespace control {
namespace {

nlohmann::json golden_fit() { return nlohmann::json::parse(std::ifstream(TEST_DATA_DIR "/fopd_discrete_order5.json")); }

DiscretisationOptions direct(double a) {
  DiscretisationOptions options;
  options.a = a;
  return options;
}

DiscretisationOptions oustaloup() {
  DiscretisationOptions options;
  options.method = DiscretisationMethod::oustaloup;
  return options;
}

// The fit as it was before its direct term was shifted.
ParallelSections uncorrected(const Discretisation& result) {
  ParallelSections sections = result.sections;
  sections.direct += result.dc_gain_before - result.dc_gain;
  return sections;
}

void expect_coefficients(const std::vector<double>& found, const std::vector<double>& expected, double relative) {
  ASSERT_EQ(found.size(), expected.size());
  double scale = 0;
  for (const double value : expected) scale = std::max(scale, std::abs(value));
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], relative * scale) << k;
}

TEST(Discretise, ReproducesTheReferenceCoefficients) {
  const std::vector<std::pair<const char*, DiscretisationOptions>> cases{{"dk_a0_M2048", direct(0)},
                                                                         {"dk_a0.5_M2048", direct(0.5)},
                                                                         {"dk_a0.9_M2048", direct(0.9)},
                                                                         {"oustaloup5_0.1_1000_tustin", oustaloup()}};
  const auto sets = golden_fit()["reference_sets"];
  for (const auto& [name, options] : cases) {
    SCOPED_TRACE(name);
    const Discretisation result = discretise(kPaperController, options);
    const DiscreteTransferFunction transfer = to_transfer_function(uncorrected(result), options.period_s);
    expect_coefficients(transfer.numerator, sets[name]["b"], 1e-9);
    expect_coefficients(transfer.denominator, sets[name]["a"], 1e-9);
    EXPECT_NEAR(result.dc_gain_before, sets[name]["dc"], 1e-6);
    EXPECT_NEAR(result.largest_pole, sets[name]["max_pole"], 1e-8);
  }
}

TEST(Discretise, MeetsTheLimitsOfTheReferenceFits) {
  const std::vector<std::tuple<double, double, double>> limits{{0.5, 0.01, 0.01}, {0.9, 0.02, 0.02}};
  for (const auto& [a, fit, in_bandwidth] : limits) {
    const Discretisation result = discretise(kPaperController, direct(a));
    EXPECT_LE(result.errors.fit_max_relative, fit);
    EXPECT_TRUE(result.is_stable);
    EXPECT_TRUE(result.is_minimum_phase);
    const DiscretisationErrors errors = measure_errors(uncorrected(result), 0.01, kPaperController, 30);
    EXPECT_LE(errors.max_relative_in_bandwidth, in_bandwidth);
    EXPECT_LE(errors.max_deg_in_bandwidth, 0.6);
  }
}

TEST(Discretise, MeasuresTheErrorsOfTheReferenceSets) {
  const auto reference = golden_fit();
  const std::vector<double> w = reference["w"];
  for (const auto& [name, set] : reference["reference_sets"].items()) {
    SCOPED_TRACE(name);
    const auto& expected = set["errors_vs_exact"];
    const ParallelSections sections = to_parallel_sections({set["b"], set["a"], 0.01});
    const DiscretisationErrors errors = measure_errors(sections, 0.01, kPaperController, 30);
    EXPECT_NEAR(errors.band_low_rad_s, w.front(), 1e-12);
    EXPECT_NEAR(errors.band_high_rad_s, w.back(), 1e-6);
    EXPECT_NEAR(errors.max_db, expected["max_db"], 1e-3);
    EXPECT_NEAR(errors.max_deg, expected["max_deg"], 0.02);
    // The reference has 80 frequencies, so that these two differ in where the frequencies lie.
    EXPECT_NEAR(errors.rms_relative, expected["rms_rel"], 0.12 * expected["rms_rel"].get<double>());
    EXPECT_NEAR(errors.max_relative_in_bandwidth, expected["max_rel_below30"], 1e-3);
    EXPECT_NEAR(errors.max_deg_in_bandwidth, expected["max_deg_below30"], 0.05);
  }
}

TEST(Discretise, HasTheReferenceGeneratingFunction) {
  const auto reference = golden_fit();
  const std::vector<double> w = reference["w"];
  for (const double a : {0.0, 0.5, 0.9}) {
    const auto& expected = reference["generating"][a == 0 ? "a=0" : a == 0.5 ? "a=0.5" : "a=0.9"];
    for (std::size_t i = 0; i < w.size(); ++i) {
      const Complex value = generating_function(kPaperController, a, 0.01, std::polar(1.0, w[i] * 0.01));
      const Complex exact{expected["re"][i].get<double>(), expected["im"][i].get<double>()};
      ASSERT_LT(std::abs(value - exact), 1e-9 * std::abs(exact)) << a << " " << w[i];
    }
  }
}

TEST(Discretise, HasADcGainOfExactlyKp) {
  for (const auto& options : {direct(0), direct(0.5), direct(0.9), oustaloup()}) {
    const Discretisation result = discretise(kPaperController, options);
    EXPECT_NEAR(dc_gain(result.sections), kPaperController.kp, 1e-12 * kPaperController.kp);
    EXPECT_NEAR(dc_gain(result.transfer.value()), kPaperController.kp, 1e-9 * kPaperController.kp);
  }
}

TEST(Discretise, OustaloupIsTheMoreAccurateBelowTheBandwidthAndTheDirectMethodInPhaseNearNyquist) {
  const auto rational = discretise(kPaperController, oustaloup()).errors;
  const auto direct_half = discretise(kPaperController, direct(0.5)).errors;
  const auto direct_most = discretise(kPaperController, direct(0.8)).errors;
  EXPECT_LT(rational.max_relative_in_bandwidth, direct_half.max_relative_in_bandwidth);
  EXPECT_LT(rational.max_relative_in_bandwidth, direct_most.max_relative_in_bandwidth);
  EXPECT_LT(direct_most.max_deg, 1);
  EXPECT_GT(rational.max_deg, 5);
}

TEST(Discretise, LosesLessThanAMillionthOfTheDutyInFloat32) {
  EXPECT_LT(discretise(kPaperController, direct(0.5)).float32_rms_duty, 1e-6);
  EXPECT_LT(discretise(kPaperController, direct(0)).float32_rms_duty, 1e-6);
  EXPECT_LT(discretise(kPaperController, oustaloup()).float32_rms_duty, 1e-6);
}

TEST(Discretise, UsesNoMoreSectionsThanAnExactlyRationalControllerHas) {
  const Discretisation classical = discretise({40, 0.05, 1}, direct(0.5));
  EXPECT_EQ(classical.sections.first_order.size(), 1U);
  EXPECT_LT(classical.errors.fit_max_relative, 1e-9);
  const Discretisation euler = discretise({40, 0.05, 1}, direct(0));
  EXPECT_EQ(euler.transfer->numerator.size(), 2U);
  EXPECT_LT(euler.errors.fit_max_relative, 1e-9);
  const Discretisation proportional = discretise({40, 0, 0.5}, direct(0.5));
  EXPECT_NEAR(proportional.sections.direct, 40, 1e-9);
  EXPECT_NEAR(proportional.noise_gain, 40, 1e-9);
}

// Whatever comes out is stable, has the DC gain, and answers within the errors it reports at any frequency asked.
void expect_sound(const FopdController& controller, const DiscretisationOptions& options, double position) {
  const Discretisation result = discretise(controller, options);
  EXPECT_TRUE(result.is_stable);
  EXPECT_LT(result.largest_pole, 1);
  EXPECT_NEAR(result.dc_gain, controller.kp, 1e-12 * (controller.kp + result.noise_gain));
  EXPECT_GT(result.noise_gain, 0);
  EXPECT_TRUE(std::isfinite(result.float32_rms_duty));
  const auto& errors = result.errors;
  const double omega = errors.band_low_rad_s * std::pow(errors.band_high_rad_s / errors.band_low_rad_s, position);
  const Complex ratio =
      discrete_response(result.sections, options.period_s, omega) / controller_transfer(controller, Complex(0, omega));
  EXPECT_LE(std::abs(20 * std::log10(std::abs(ratio))), 1.1 * errors.max_db + 0.01);
  EXPECT_LE(std::abs(std::arg(ratio)) * 57.29578, 1.1 * errors.max_deg + 0.1);
}

// Whatever a refusal says works in its place does.
void expect_true_advice(const std::string& refusal, const FopdController& controller,
                        const DiscretisationOptions& refused) {
  const auto expect_works = [&](auto change) {
    DiscretisationOptions options = refused;
    change(options);
    EXPECT_NO_THROW(discretise(controller, options)) << refusal;
  };
  const std::string text = refusal.substr(refusal.find("; ") + 1);
  ASSERT_NE(text.find("works in its place: "), std::string::npos) << refusal;
  std::smatch match;
  if (std::regex_search(text, match, std::regex("order (\\d+) \\(off by"))) {
    expect_works([&](auto& options) { options.order = std::stoi(match[1]); });
  }
  if (std::regex_search(text, match, std::regex("a = ([0-9.]+) \\(off by"))) {
    EXPECT_NE(std::stod(match[1]), refused.a);
    expect_works([&](auto& options) { options.a = std::stod(match[1]); });
  }
  EXPECT_NE(text.find("Oustaloup's method (off by"), std::string::npos) << refusal;
}

TEST(Discretise, GivesNoAdviceThatDoesNotHelp) {
  int refusals = 0;
  for (const double period_s : {0.001, 0.01}) {
    for (const int order : {1, 2, 3, 10}) {
      for (const double a : {0.0, 0.9}) {
        DiscretisationOptions options = direct(a);
        options.period_s = period_s;
        options.order = order;
        try {
          discretise(kPaperController, options);
        } catch (const std::runtime_error& error) {
          expect_true_advice(error.what(), kPaperController, options);
          ++refusals;
        }
      }
    }
  }
  EXPECT_GT(refusals, 3);
}

// The largest relative difference of the coefficients' response from the sections', at DC and over the band.
double off_by(const DiscreteTransferFunction& transfer, const ParallelSections& sections) {
  double largest = std::abs(dc_gain(transfer) / dc_gain(sections) - 1);
  for (double omega = 0.1; omega < 0.8 * 3.1416 / transfer.period_s; omega *= 1.3) {
    const Complex exact = discrete_response(sections, transfer.period_s, omega);
    largest = std::max(largest, std::abs(discrete_response(transfer, omega) / exact - 1.0));
  }
  return largest;
}

TEST(Discretise, PublishesNoCoefficientsThatAreNotTheSections) {
  int without = 0;
  for (const double period_s : {0.001, 0.002, 0.005, 0.01}) {
    for (int order = 1; order <= 10; ++order) {
      for (const bool is_direct : {false, true}) {
        DiscretisationOptions options = is_direct ? direct(0.25) : oustaloup();
        options.period_s = period_s;
        options.order = order;
        SCOPED_TRACE(testing::Message() << period_s << " s, order " << order << ", direct " << is_direct);
        std::optional<Discretisation> result;
        try {
          result = discretise(kPaperController, options);
        } catch (const std::runtime_error&) {
          continue;
        }
        EXPECT_NEAR(dc_gain(result->sections), kPaperController.kp, 1e-11 * kPaperController.kp);
        EXPECT_EQ(result->transfer.has_value(), result->transfer_max_relative <= 1e-6);
        EXPECT_EQ(result->transfer.has_value(), result->transfer_note.empty());
        if (result->transfer) EXPECT_LE(off_by(*result->transfer, result->sections), 1e-6);
        without += result->transfer ? 0 : 1;
        if (order <= 4) EXPECT_TRUE(result->transfer);
        if ((period_s == 0.01 || is_direct) && order <= 8) EXPECT_TRUE(result->transfer);
        if (period_s == 0.001 && order >= 7 && !is_direct) EXPECT_FALSE(result->transfer);
      }
    }
  }
  EXPECT_GT(without, 0);
}

TEST(Discretise, IsSoundOrSaysWhatToChangeForRandomControllersAndRates) {
  std::mt19937 generator{11};
  std::uniform_real_distribution<double> log_kp(0, 5), log_kd(-5, -1), mu(0.05, 1.95), log_period(-6.9, -2.3),
      unit(0, 1);
  std::uniform_int_distribution<int> order(1, 8), method(0, 3);
  int failed = 0;
  for (int round = 0; round < 60; ++round) {
    const FopdController controller{std::exp(log_kp(generator)), std::exp(log_kd(generator)), mu(generator)};
    DiscretisationOptions options = method(generator) == 0 ? oustaloup() : direct(unit(generator));
    options.period_s = std::exp(log_period(generator));
    options.order = order(generator);
    SCOPED_TRACE(testing::Message() << controller.kp << " " << controller.kd << " " << controller.mu << ", a "
                                    << options.a << ", " << options.period_s << " s, order " << options.order);
    try {
      expect_sound(controller, options, unit(generator));
    } catch (const std::runtime_error& error) {
      expect_true_advice(error.what(), controller, options);
      EXPECT_EQ(options.method, DiscretisationMethod::direct);
      ++failed;
    }
  }
  EXPECT_LT(failed, 30);
}

TEST(ChooseDiscretisation, TakesTheLeastNoisyOfTheAccurateOnesAndSaysWhy) {
  const DiscretisationChoice choice = choose_discretisation(kPaperController, 0.01, 5, 30);
  EXPECT_EQ(choice.compared.size(), 7U);
  EXPECT_LE(choice.chosen.errors.max_relative_in_bandwidth, 0.01);
  EXPECT_LE(choice.chosen.errors.max_deg_in_bandwidth, 0.6);
  for (const auto& other : choice.compared) {
    if (other.errors.max_relative_in_bandwidth > 0.01 || other.errors.max_deg_in_bandwidth > 0.6) continue;
    EXPECT_LE(choice.chosen.noise_gain, other.noise_gain);
  }
  EXPECT_EQ(choice.chosen.options.method, DiscretisationMethod::direct);
  EXPECT_EQ(choice.chosen.options.a, 0.25);
  EXPECT_NE(choice.reason.find("a = 0.25"), std::string::npos) << choice.reason;
  EXPECT_NE(choice.reason.find("least duty noise"), std::string::npos) << choice.reason;
}

TEST(ChooseDiscretisation, TakesTheMostAccurateIfNoneIsAccurate) {
  const DiscretisationChoice choice = choose_discretisation(kPaperController, 0.1, 2, 20);
  for (const auto& other : choice.compared) {
    EXPECT_LE(choice.chosen.errors.max_relative_in_bandwidth, other.errors.max_relative_in_bandwidth);
  }
  EXPECT_NE(choice.reason.find("none of them"), std::string::npos) << choice.reason;
  EXPECT_EQ(choice.reason.find("would help"), std::string::npos) << choice.reason;
}

TEST(ChooseDiscretisation, CountsAndNamesWhatWasRefused) {
  for (const int order : {1, 2, 3, 5, 9}) {
    const DiscretisationChoice choice = choose_discretisation(kPaperController, 0.001, order, 30);
    SCOPED_TRACE(choice.reason);
    EXPECT_EQ(choice.compared.size() + choice.refused.size(), 7U);
    EXPECT_NE(choice.reason.find("of 7 tried"), std::string::npos);
    for (const auto& [name, reason] : choice.refused) {
      EXPECT_NE(name.find("direct method with a = "), std::string::npos);
      EXPECT_FALSE(reason.empty());
    }
  }
  EXPECT_FALSE(choose_discretisation(kPaperController, 0.001, 1, 30).refused.empty());
}

TEST(Discretise, RefusesOptionsOutsideTheirRange) {
  const auto refuses = [](auto change) {
    DiscretisationOptions options;
    change(options);
    EXPECT_THROW(discretise(kPaperController, options), std::invalid_argument);
  };
  refuses([](auto& o) { o.period_s = 0; });
  refuses([](auto& o) { o.order = 0; });
  refuses([](auto& o) { o.order = 11; });
  refuses([](auto& o) { o.a = 1.1; });
  refuses([](auto& o) { o.a = std::nan(""); });
  refuses([](auto& o) { o.grid_points = 1000; });
  refuses([](auto& o) { o.loop_bandwidth_rad_s = -1; });
  refuses([](auto& o) {
    o.method = DiscretisationMethod::oustaloup;
    o.band_low_rad_s = 1000;
  });
  EXPECT_THROW(discretise({-1, 0.1, 0.5}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace control
