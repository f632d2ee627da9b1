// The two methods, and what is reported of their results.
#include "control/discretisation/discretise.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <expected>
#include <iomanip>
#include <numbers>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <unsupported/Eigen/FFT>

#include "base/invalid_argument.hpp"
#include "control/discretisation/oustaloup.hpp"
#include "control/discretisation/steiglitz_mcbride.hpp"
#include "control/responses/closed_loop.hpp"

namespace control {
namespace {

constexpr int kIterations = 10;
constexpr double kUselessFit = 0.25;  // relative
constexpr double kGoodRelative = 0.01, kGoodDeg = 0.6;
constexpr double kStepS = 20;
constexpr int kStepSamples = 2000;
constexpr double kUselessTransfer = 1e-6;  // relative
constexpr double kNothingLeft = 1e300;     // of the digits of a transfer function
constexpr double kTriedA[] = {0.0, 0.25, 0.5, 0.8, 0.9, 1.0};

template <class... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  base::throw_invalid("discretisation: ", parts...);
}

void check(const FopdController& controller, const DiscretisationOptions& options) {
  check(controller);
  if (!base::is_positive(options.period_s)) refuse("period_s must be positive, is ", options.period_s);
  if (options.order < 1 || options.order > kLargestOrder) {
    refuse("order must lie in 1..", kLargestOrder, ", is ", options.order);
  }
  if (!base::is_positive(options.loop_bandwidth_rad_s)) {
    refuse("loop_bandwidth_rad_s must be positive, is ", options.loop_bandwidth_rad_s);
  }
  if (options.method == DiscretisationMethod::oustaloup) {
    const double low = options.band_low_rad_s, high = options.band_high_rad_s;
    if (base::is_positive(low) && high > low && std::isfinite(high)) return;
    refuse("the band must have 0 < band_low_rad_s < band_high_rad_s, has ", low, " and ", high);
  }
  if (!(options.a >= 0 && options.a <= 1)) refuse("a must lie in [0, 1], is ", options.a);
  const int points = options.grid_points;
  if (points < 128 || points > 65536 || !std::has_single_bit(static_cast<unsigned>(points))) {
    refuse("grid_points must be a power of two in 128..65536, is ", points);
  }
}

// (2) up to the fit. At z = -1 Tustin's s is infinite: there, the value half a grid step aside.
std::vector<double> impulse_response(const FopdController& controller, const DiscretisationOptions& options) {
  const int points = options.grid_points;
  std::vector<Complex> response(static_cast<std::size_t>(points)), samples;
  for (int k = 0; k <= points / 2; ++k) {
    const bool is_pole = options.a == 1 && k == points / 2;
    const double angle = 2 * std::numbers::pi * (k - (is_pole ? 0.5 : 0)) / points;
    const Complex value = generating_function(controller, options.a, options.period_s, std::polar(1.0, angle));
    response[static_cast<std::size_t>(k)] = value;
    if (k > 0) response[static_cast<std::size_t>(points - k)] = std::conj(value);
  }
  response[response.size() / 2] = response[response.size() / 2].real();
  Eigen::FFT<double> fft;
  fft.inv(samples, response);
  std::vector<double> half;
  for (std::size_t k = 0; k < samples.size() / 2; ++k) half.push_back(samples[k].real());
  return half;
}

struct DirectFit {
  ParallelSections sections;
  double output_error = 0;  // in the impulse response
  bool is_minimum_phase = false;
};

double largest(const std::vector<Complex>& values) {
  double result = 0;
  for (const Complex value : values) result = std::max(result, std::abs(value));
  return result;
}

std::expected<ParallelSections, std::string> fit_direct(const FopdController& controller,
                                                        const DiscretisationOptions& options) {
  std::optional<DirectFit> best;
  for (const auto& [b, a, error] :
       steiglitz_mcbride(impulse_response(controller, options), options.order, kIterations)) {
    auto sections = partial_fractions({b, a, options.period_s});
    if (!sections || b[0] == 0) continue;
    const bool is_minimum_phase = largest(zeros(*sections)) < 1;
    const bool is_better =
        !best || (is_minimum_phase == best->is_minimum_phase ? error < best->output_error : is_minimum_phase);
    if (is_better) best = DirectFit{*std::move(sections), error, is_minimum_phase};
  }
  if (best) return std::move(best->sections);
  return std::unexpected("gives no stable fit with distinct poles");
}

// The error signal on which float32 and double are compared.
std::vector<double> step_error_m(const ParallelSections& sections, double period_s) {
  ClosedLoopExperiment experiment;
  experiment.controller = sections;
  experiment.period_s = period_s;
  experiment.duration_s = std::min(kStepS, kStepSamples * period_s);
  experiment.disturbance_at_s = 2 * experiment.duration_s;
  const ClosedLoopPrediction prediction = predict_closed_loop(experiment);
  std::vector<double> error_m = prediction.reference_m;
  for (std::size_t k = 0; k < error_m.size(); ++k) error_m[k] -= prediction.measured_m[k];
  return error_m;
}

// The coefficients, if they hold the sections.
void add_transfer(Discretisation& result) {
  const double period_s = result.options.period_s;
  DiscreteTransferFunction transfer = to_transfer_function(result.sections, period_s);
  std::vector<double> omega_rad_s = error_frequencies(period_s, result.options.loop_bandwidth_rad_s);
  omega_rad_s.push_back(0);
  for (const double omega : omega_rad_s) {
    const Complex ratio = discrete_response(transfer, omega) / discrete_response(result.sections, period_s, omega);
    const double off = std::abs(ratio - 1.0);  // infinite or NaN where the denominator has rounded to 0
    result.transfer_max_relative = std::isfinite(off) ? std::max(result.transfer_max_relative, off) : kNothingLeft;
    if (!std::isfinite(off)) break;
  }
  if (result.transfer_max_relative <= kUselessTransfer) {
    result.transfer = std::move(transfer);
    return;
  }
  result.transfer_note =
      base::join_text("no numerator and denominator: with poles this near 1 (order ", result.options.order, " at ",
                      period_s, " s) coefficients in double are off by ", std::setprecision(2),
                      100 * result.transfer_max_relative, " % of the response; run the sections, which are not");
}

// Why not, without naming the options.
std::expected<Discretisation, std::string> try_discretise(const FopdController& controller,
                                                          const DiscretisationOptions& options) {
  check(controller, options);
  Discretisation result;
  result.options = options;
  double fit_max_relative = 0;
  if (options.method == DiscretisationMethod::oustaloup) {
    const OustaloupBand band{options.band_low_rad_s, options.band_high_rad_s};
    result.sections = oustaloup_tustin(controller, band, options.order, options.period_s);
  } else {
    auto fit = fit_direct(controller, options);
    if (!fit) return std::unexpected(std::move(fit.error()));
    result.sections = *std::move(fit);
    fit_max_relative = max_fit_error(result.sections, options.period_s, controller, options.a,
                                     error_frequencies(options.period_s, options.loop_bandwidth_rad_s));
    if (!(fit_max_relative <= kUselessFit)) {
      return std::unexpected(base::join_text("fits only to ", std::setprecision(3), 100 * fit_max_relative, " %"));
    }
  }
  result.dc_gain_before = dc_gain(result.sections);
  for (int pass = 0; pass < 2; ++pass) result.sections.direct += controller.kp - dc_gain(result.sections);  // (4)
  result.dc_gain = dc_gain(result.sections);
  add_transfer(result);
  result.errors = measure_errors(result.sections, options.period_s, controller, options.loop_bandwidth_rad_s);
  result.errors.fit_max_relative = fit_max_relative;
  result.largest_pole = largest(poles(result.sections));
  result.largest_zero = largest(zeros(result.sections));
  result.is_stable = result.largest_pole < 1;
  result.is_minimum_phase = result.largest_zero < 1;
  result.noise_gain = white_noise_gain(result.sections);
  result.float32_rms_duty = float32_rms_error(result.sections, step_error_m(result.sections, options.period_s));
  return result;
}

std::string name_of(const DiscretisationOptions& options) {
  if (options.method == DiscretisationMethod::oustaloup) return "Oustaloup and Tustin";
  return base::join_text("direct method with a = ", options.a);
}

// What works where these options do not: every one has been tried.
std::string advice(const FopdController& controller, const DiscretisationOptions& refused) {
  std::string advice;
  const auto works = [&](const DiscretisationOptions& options, const std::string& name) {
    const auto tried = try_discretise(controller, options);
    if (!tried || !tried->is_stable) return false;
    advice += base::join_text(advice.empty() ? "" : ", ", name, std::setprecision(2), " (off by ",
                              100 * tried->errors.max_relative_in_bandwidth, " % below ", std::setprecision(4),
                              tried->errors.bandwidth_rad_s, " rad/s)");
    return true;
  };
  DiscretisationOptions options = refused;
  for (int distance = 1; distance < kLargestOrder; ++distance) {  // the nearest order
    bool is_found = false;
    for (const int order : {refused.order + distance, refused.order - distance}) {
      options.order = order;
      is_found = is_found || (order >= 1 && order <= kLargestOrder && works(options, base::join_text("order ", order)));
    }
    if (is_found) break;
  }
  options = refused;
  for (const double a : kTriedA) {
    options.a = a;
    if (a != refused.a && works(options, base::join_text("a = ", a))) break;
  }
  options = refused;
  options.method = DiscretisationMethod::oustaloup;
  works(options, "Oustaloup's method");
  return advice.empty() ? "no other order, no other a and not Oustaloup's method comes out stable either; change the "
                          "period"
                        : "what works in its place: " + advice;
}

bool is_accurate(const Discretisation& tried) {
  return tried.errors.max_relative_in_bandwidth <= kGoodRelative && tried.errors.max_deg_in_bandwidth <= kGoodDeg;
}

std::string reason_for(const DiscretisationChoice& choice) {
  const auto accurate = std::ranges::count_if(choice.compared, is_accurate);
  const auto& errors = choice.chosen.errors;
  std::string name = name_of(choice.chosen.options);
  if (choice.chosen.options.method == DiscretisationMethod::direct) name = "The " + name;
  std::ostringstream text;
  text << std::setprecision(3) << name << " is off by at most " << 100 * errors.max_relative_in_bandwidth << " % and "
       << errors.max_deg_in_bandwidth << " degrees below " << errors.bandwidth_rad_s << " rad/s";
  const std::size_t tried = choice.compared.size() + choice.refused.size();
  if (choice.compared.size() == 1) {
    text << ", and the only one of " << tried << " tried that comes out stable and near its target.";
  } else if (accurate == 0) {
    text << ", the least of the " << choice.compared.size() << " of " << tried
         << " tried that come out stable and near their target; none of them stays within 1 % and 0.6 degrees there.";
  } else if (accurate == 1) {
    text << "; of " << tried << " tried it is the only one that stays within 1 % and 0.6 degrees there.";
  } else {
    text << "; of the " << accurate << " of " << tried
         << " tried that stay within 1 % and 0.6 degrees there, it has the least duty noise.";
  }
  text << " Its duty noise is " << choice.chosen.noise_gain << " per m of noise on the position.";
  return text.str();
}

}  // namespace

Discretisation discretise(const FopdController& controller, const DiscretisationOptions& options) {
  auto result = try_discretise(controller, options);
  if (!result) {
    throw std::runtime_error(base::join_text("discretisation: the ", name_of(options), " of order ", options.order,
                                             " at ", options.period_s, " s ", result.error(), "; ",
                                             advice(controller, options)));
  }
  return *std::move(result);
}

DiscretisationChoice choose_discretisation(const FopdController& controller, double period_s, int order,
                                           double loop_bandwidth_rad_s) {
  DiscretisationOptions options;
  options.period_s = period_s;
  options.order = order;
  options.loop_bandwidth_rad_s = loop_bandwidth_rad_s;
  DiscretisationChoice choice;
  const auto compare = [&] {
    auto tried = try_discretise(controller, options);
    if (!tried) {
      choice.refused.push_back({name_of(options), tried.error()});
    } else if (!tried->is_stable) {
      choice.refused.push_back({name_of(options), base::join_text("has a pole of magnitude ", tried->largest_pole)});
    } else {
      choice.compared.push_back(*std::move(tried));
    }
  };
  for (const double a : kTriedA) {
    options.a = a;
    compare();
  }
  options.method = DiscretisationMethod::oustaloup;
  compare();
  if (choice.compared.empty()) {
    std::string reasons;
    for (const auto& [name, reason] : choice.refused) reasons += base::join_text("; the ", name, " ", reason);
    throw std::runtime_error(
        base::join_text("discretisation: nothing stable at ", period_s, " s with order ", order, reasons));
  }
  const auto is_better = [](const Discretisation& left, const Discretisation& right) {
    if (is_accurate(left) != is_accurate(right)) return is_accurate(left);
    if (is_accurate(left)) return left.noise_gain < right.noise_gain;
    return left.errors.max_relative_in_bandwidth < right.errors.max_relative_in_bandwidth;
  };
  choice.chosen = *std::ranges::min_element(choice.compared, is_better);
  choice.reason = reason_for(choice);
  return choice;
}

}  // namespace control
